"""Goals in the site editor: drawn, checked, kept and undone."""

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.sites.goal_sites import write_site
from tests.web.browser import Browser
from tests.web.site_editor.drawing import PATIENCE_MS, served
from tests.web.site_editor.goal_drawing import GOAL_IDS, GoalDrawing
from vsnbench.site_checks.check import check_site_file
from vsnbench.site_checks.finding import Severity
from vsnbench.sites.goals import MAX_IMAGE_BYTES
from vsnbench.sites.site import embedded_sites, load_site
from vsnbench.sites.targets import describe_goal, targets_of
from vsnbench.values.pose import Pose

APARTMENT = embedded_sites()["apartment"].read_text(encoding="utf-8")


@contextmanager
def opened(path: Path, width: int = 1280) -> Iterator[tuple[Page, GoalDrawing]]:
    """The editor of a site file in a browser; a script error fails the test."""
    problems: list[str] = []
    with served(path) as server, chromium_page(width, 1000) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        yield page, GoalDrawing(page)
    assert problems == []


def saved(page: Page) -> None:
    page.click("#save")
    page.get_by_text("lab.yaml: saved").wait_for()


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    return write_site(tmp_path)


@pytest.mark.browser
def test_points_are_placed_sequences_ordered_and_routes_photographed_along_a_way(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(APARTMENT, encoding="utf-8")
    with opened(path) as (page, drawn):
        drawn.add("point", "spot")
        for place in ((3.0, 3.0), (4.3, 3.5)):  # a second click moves the point
            drawn.press("Place the point on the plan")
            drawn.click(place)
            drawn.press("Back to goal spot")
        drawn.add("sequence", "tour")
        for leg in ("chair", "bed", "spot", "toilet"):
            page.select_option("#field-add-goal", leg)
        drawn.press("3. spot: earlier")
        page.keyboard.press("Enter")  # the button of the moved goal has the focus: again
        drawn.press("4. toilet: remove")
        drawn.add("route", "way")
        drawn.press("Draw a way and photograph it")
        drawn.click((6.0, 1.9), (4.8, 1.9), (4.3, 3.5))
        page.keyboard.press("Enter")
        page.get_by_text("4 photographs along 2.9 m.").wait_for()
        drawn.press("4. lab-way-4.png: earlier")
        for button, photographs in (("#undo", 0), ("#redo", 4)):
            page.click(button)
            page.click(button)
            shown = page.locator("#goal-list").inner_text()
            assert f"{photographs} photographs" in shown, "the photographs of a way are one step"
        page.wait_for_selector("body[data-checked=yes]")
        assert page.locator("#goal-list .found.error").count() == 0
        assert accessibility_findings(page) == []
        saved(page)
    site = load_site(str(path))
    goals = {goal.id: goal for goal in site.goals}
    assert goals["tour"].legs == ("spot", "chair", "bed")
    assert [target.point for target in goals["spot"].targets] == [pytest.approx((4.3, 3.5), abs=0.03)]
    assert [target.point for target in goals["way"].targets] == [pytest.approx((4.3, 3.5), abs=0.03)]
    assert [image.file for image in goals["way"].images] == [f"lab-way{name}.png" for name in ("", "-2", "-4", "-3")]
    photographs = [image.pixels for image in goals["way"].images]
    assert all(pixels is not None and pixels.shape == (480, 640, 3) for pixels in photographs)
    assert len({image.sha256 for image in goals["way"].images}) == 4


@pytest.mark.browser
def test_a_way_is_drawn_with_keys_on_a_narrow_screen(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(APARTMENT, encoding="utf-8")
    with opened(path, width=390) as (page, drawn):
        drawn.add("route", "way")
        page.keyboard.press("Enter")  # applies the id
        page.locator("#field-draw-a-way-and-photograph-it").focus()
        page.keyboard.press("Enter")  # the first point, in the middle of the plan
        for key in ("ArrowRight", "ArrowRight"):
            page.keyboard.press(key)
        page.keyboard.press("Enter")
        page.keyboard.press("Enter")  # the same point again ends the way
        page.get_by_text("2 photographs along 1.0 m.").wait_for()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        assert accessibility_findings(page) == []
        saved(page)
    assert len(load_site(str(path)).goals[0].images) == 2


@pytest.mark.browser
def test_goals_of_every_kind_are_drawn(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(APARTMENT, encoding="utf-8")
    with opened(path) as (page, drawn):
        drawn.draw_all()
        page.wait_for_selector("body[data-checked=yes]")
        assert page.locator("#goal-list .found.error").count() == 0
        saved(page)
    site, findings = check_site_file(path, 0.177)
    assert site is not None
    assert [finding.message for finding in findings if finding.severity is Severity.ERROR] == []
    assert {kind: tuple(goal.id for goal in site.goals if goal.kind == kind) for kind in GOAL_IDS} == GOAL_IDS
    assert {goal.id: [target.id for target in targets_of(site, goal.id)] for goal in site.goals} == {
        "red-armchair": ["armchair"],
        "open-floor": ["point:1"],
        "desk-plant": ["plant-1"],
        "photo-bed": ["bed-1"],
        "photo-sofa": ["sofa-1"],
        "to-the-rug": ["region:rug"],
        "to-the-desk": ["desk"],
    }
    (region,) = targets_of(site, "to-the-rug")
    assert region.shape.bounds == pytest.approx((7.6, 4.55, 9.2, 5.2), abs=0.03)
    assert [goal.starts for goal in site.goals[-2:]] == [list(range(1, 16)), [7, 8, 10, 11, 12]]
    assert describe_goal(site, "to-the-desk", Pose(0.0, 0.0)) == "pass the sofa and stop at the desk"
    bed, sofa = (describe_goal(site, name, Pose(0.0, 0.0)).image for name in GOAL_IDS["image"])
    assert bed is not None
    assert sofa is not None
    assert bed.shape == (480, 640, 3)
    assert bed.std() > 20
    assert np.abs(bed.astype(int) - sofa).mean() > 10, "two photographs of different things"
    assert path.read_text(encoding="utf-8").startswith(APARTMENT), "comments and layout are kept"


@pytest.mark.browser
def test_goals_are_edited_with_keys_undone_and_checked_where_they_stand(tmp_path: Path) -> None:
    path = write_site(tmp_path)
    before = path.read_text(encoding="utf-8")
    with opened(path) as (page, drawn):
        page.get_by_role("button", name="to-the-kitchen instruction").click()
        page.focus("#field-text")
        page.keyboard.press("Control+a")
        page.keyboard.type("stop in the kitchen")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.closest('form').id") == "selection", "Tab finds the next field"
        page.focus("#field-draw-a-region")
        page.keyboard.press("Enter")
        corner = float(page.input_value("#field-corner-1-x"))
        page.keyboard.press("ArrowRight")
        assert float(page.input_value("#field-corner-1-x")) == pytest.approx(corner + 0.05)
        page.keyboard.press("Delete")
        drawn.field("starts", "1-3, 77")
        page.wait_for_selector("#goal-list li:last-child .found.error")
        assert "77" in page.inner_text("#goal-list li:last-child .found.error")
        page.click("#undo")
        page.wait_for_selector("body[data-checked=yes]")
        assert page.locator("#goal-list .found.error").count() == 0
        page.get_by_role("button", name="photo-bed image").click()
        page.locator("#field-delete").press("Enter")
        saved(page)
    after = path.read_text(encoding="utf-8")
    changed = before.replace("leave the bedroom and stop in the kitchen", '"stop in the kitchen"')
    lines = [line for line in changed.splitlines() if "photo-bed" not in line]
    assert after.splitlines() == lines


@pytest.mark.browser
def test_a_renamed_object_remains_a_target(tmp_path: Path) -> None:
    path = write_site(tmp_path)
    with opened(path) as (page, drawn):
        page.get_by_role("button", name="armchair (chair)").click()
        drawn.field("id", "reading-chair")
        saved(page)
    assert [target.id for target in targets_of(load_site(path), "red-armchair")] == ["reading-chair"]


@pytest.mark.browser
def test_the_page_with_goals_is_accessible_on_a_phone_and_a_desk(tmp_path: Path) -> None:
    with opened(write_site(tmp_path)) as (page, _):
        for goal in ("photo-bed image", "to-the-kitchen instruction"):
            page.get_by_role("button", name=goal).click()
            assert accessibility_findings(page) == []
        page.set_viewport_size({"width": 390, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, "nothing is cut off"


def picture(size: tuple[int, int] = (48, 64)) -> bytes:
    pixels = np.random.default_rng(3).integers(0, 256, (*size, 3)).astype(np.uint8)
    return cv2.imencode(".png", pixels)[1].tobytes()


def test_an_uploaded_image_never_replaces_another(browser: Browser, tmp_path: Path) -> None:
    content = base64.b64encode(picture()).decode()
    names = [browser.post("/goal-image", goal="red-armchair", image=content).json["file"] for _ in range(2)]
    assert names == ["lab-red-armchair.png", "lab-red-armchair-2.png"]
    assert (tmp_path / names[1]).read_bytes() == picture()
    shown = browser.ask("GET", f"/goal-image?file={names[0]}")
    assert (shown.status, shown.body, shown.headers["content-type"]) == (200, picture(), "image/png")


@pytest.mark.parametrize("data", [b"", b"no image", picture()[:200], picture() + bytes(MAX_IMAGE_BYTES)])
def test_what_is_no_image_is_refused_and_not_stored(browser: Browser, tmp_path: Path, data: bytes) -> None:
    before = sorted(tmp_path.iterdir())
    answer = browser.post("/goal-image", goal="red-armchair", image=base64.b64encode(data).decode())
    assert (answer.status, answer.json["code"]) == (409, "invalid-image")
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", ["", "lab.yaml", "../secret.png", "/etc/passwd", "gone.png", "a%00b.png"])
def test_only_images_next_to_the_site_are_shown(browser: Browser, tmp_path: Path, name: str) -> None:
    assert browser.ask("GET", f"/goal-image?file={name}").status == 409


def test_a_photo_of_an_incomplete_goal_is_stored_under_a_safe_name(browser: Browser, tmp_path: Path) -> None:
    site = browser.ask("GET", "/state").json["site"]
    site["goals"].append({"id": "../x", "kind": "image"})
    pose = {"x_m": 2.5, "y_m": 3.0, "heading_deg": 90}
    answer = browser.post("/goal-photo", site=site, goal="../x", **pose)
    assert answer.json["file"] == "lab-goal.png"
    assert (tmp_path / "lab-goal.png").read_bytes().startswith(b"\x89PNG")
    assert browser.post("/goal-photo", site=site, goal="x", **pose | {"x_m": "a"}).status == 400


def test_a_fault_of_a_goal_is_a_finding_at_its_entry(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    site["goals"][0]["targets"] = ["armchairs"]
    site["goals"][2]["image"] = "gone.png"
    findings = browser.post("/check", site=site).json["findings"]
    assert [finding["entries"] for finding in findings] == [[["goals", 2]]]
    site["goals"][2]["image"] = "bed.png"
    (finding,) = browser.post("/check", site=site).json["findings"]
    assert (finding["entries"], finding["severity"]) == ([["goals", 0]], "error")


@pytest.mark.browser
def test_goals_that_break_the_format_are_shown_with_their_faults(tmp_path: Path) -> None:
    goals = """
goals:
  - {id: 3, kind: [text], text: {a: b}, targets: {region: sofa}}
  - {id: b, kind: text, text: the sofa, targets: [7, null, {region: [[0, 0], x]}, {point: [1]}], starts: soon}
  - {kind: image, image: [1]}
"""
    with opened(write_site(tmp_path, goals)) as (page, _):
        page.wait_for_selector("#goal-list .found.error")
        for number in range(3):
            page.locator("#goal-list > li > button").nth(number).click()
            assert page.locator("#goal-list > li").nth(number).locator(".found.error").count() > 0
            assert page.locator("#field-delete").count() == 1
