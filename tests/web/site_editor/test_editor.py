"""The site editor over HTTP, and in a browser with mouse, touch and keyboard."""

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.web.browser import Browser
from tests.web.site_editor.drawing import PATIENCE_MS, Drawing, served
from vsnbench.interop.ros_map import write_ros_map
from vsnbench.interop.site_map import map_of_site
from vsnbench.sites.site import load_site
from vsnbench.web.site_editor.document import SiteDocument
from vsnbench.web.site_editor.underlay import Underlay

FLAT = Path(__file__).parents[2] / "site_checks" / "flat.yaml"


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    path = tmp_path / "flat.yaml"
    path.write_bytes(FLAT.read_bytes())
    return path


def test_findings_are_those_of_sites_check(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    assert browser.post("/check", site=site).json == {"findings": []}
    del site["walls"][4]
    codes = [finding["code"] for finding in browser.post("/check", site=site).json["findings"]]
    assert "edge-without-wall" in codes
    site["starts"][0]["heading_deg"] = "north"
    (finding,) = browser.post("/check", site=site).json["findings"]
    assert finding["code"] == "format"
    assert finding["entries"] == [["starts", 0]]


def test_repeated_saves_keep_the_comments(browser: Browser, site_file: Path) -> None:
    site = browser.ask("GET", "/state").json["site"]
    site["title"] = "A flat"
    site = browser.post("/save", site=site).json["site"]
    site["title"] = "Our flat"
    assert browser.post("/save", site=site).status == 200
    text = site_file.read_text(encoding="utf-8")
    assert text.startswith("# A sound flat of two rooms")
    assert load_site(site_file).title == "Our flat"


def test_a_preview_is_a_jpeg(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    preview = browser.post("/preview", site=site, x_m=2.5, y_m=2.2, heading_deg=90)
    assert preview.headers["content-type"] == "image/jpeg"
    assert preview.body.startswith(b"\xff\xd8")


@pytest.mark.parametrize(
    ("path", "content", "status"),
    [
        ("/check", {}, 400),
        ("/check", {"site": {"walls": [3]}}, 400),
        ("/preview", {"site": {}, "x_m": "a", "y_m": 1, "heading_deg": 0}, 400),
        ("/preview", {"site": {}, "x_m": 1, "y_m": 1, "heading_deg": 0}, 409),
        ("/scan-view", {"site": {}, "x_m": 1, "y_m": 1, "heading_deg": 0}, 409),
        ("/underlay", {"image": "*"}, 400),
        ("/underlay", {"image": base64.b64encode(b"no picture").decode()}, 409),
    ],
)
def test_invalid_requests_are_refused_with_a_message(
    browser: Browser, path: str, content: dict[str, object], status: int
) -> None:
    answer = browser.post(path, **content)
    assert answer.status == status
    assert answer.json["message"]


def box_of(page: Page, selector: str) -> dict[str, float]:
    """Return the box of an element as soon as it is drawn."""
    found = page.wait_for_function(
        """selector => {
          const box = document.querySelector(selector)?.getBoundingClientRect();
          return box && box.width + box.height > 0 ? box.toJSON() : null;
        }""",
        arg=selector,
    )
    box: dict[str, float] = found.json_value()
    return box


@pytest.mark.browser
def test_a_flat_is_drawn_from_a_map_with_mouse_and_keyboard(tmp_path: Path) -> None:
    surveyed = load_site(FLAT)
    write_ros_map(map_of_site(surveyed, furniture=False), tmp_path / "map.yaml")
    path = tmp_path / "drawn.yaml"
    underlay = Underlay.of_file(tmp_path / "map.yaml")
    with served(path, underlay) as server, chromium_page(1280, 800) as page:
        problems: list[str] = []
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]", timeout=PATIENCE_MS)
        drawn = Drawing(page)
        page.click("#accept-lines")
        drawn.tool("room")
        drawn.click((0, 0), (4, 0), (4, 5), (0, 5))
        page.keyboard.press("Enter")
        drawn.field("name", "hall")
        drawn.click((4, 0), (6, 0), (6, 5), (4, 5))  # starts at a corner of the selected room
        page.keyboard.press("Enter")
        drawn.tool("start")
        drawn.click((2.5, 2.2))
        drawn.field("heading_deg", "90")
        drawn.tool("sofa")
        drawn.click((2, 4))
        page.keyboard.press("r")
        page.keyboard.press("ArrowLeft")
        drawn.field("x-m", "1.5")
        page.click("#undo")
        page.click("#redo")
        page.click("#save")
        page.get_by_text("saved", exact=False).first.wait_for(timeout=PATIENCE_MS)
        page.wait_for_selector("body[data-checked=yes]", timeout=PATIENCE_MS)
        page.locator("#findings button").first.click()
    assert problems == []
    site = load_site(path)
    assert [room.shape.area for room in site.rooms] == [pytest.approx(20, abs=0.5), pytest.approx(10, abs=0.5)]
    assert len(site.walls) >= 4
    assert [door.length_m for door in site.doors] == [pytest.approx(0.8, abs=0.06)]
    assert site.starts[0].heading_deg == 90
    (sofa,) = site.objects
    assert (sofa.position[0], sofa.heading_deg) == (1.5, 15)


def dragged_by_fingers(page: Page, *ways: list[tuple[float, float]]) -> None:
    """Move one finger along each path, at the same time."""
    fingers = page.context.new_cdp_session(page)

    def touch(kind: str, points: list[tuple[float, float]]) -> None:
        places = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    for down in range(1, len(ways) + 1):
        touch("touchStart", [way[0] for way in ways[:down]])
    for step in range(1, len(ways[0])):
        touch("touchMove", [way[step] for way in ways])
    touch("touchEnd", [])


@pytest.mark.browser
def test_a_tablet_scales_an_image_draws_by_touch_and_pinches(tmp_path: Path) -> None:
    path = tmp_path / "drawn.yaml"
    picture = np.full((300, 400, 3), 255, np.uint8)
    cv2.rectangle(picture, (50, 50), (350, 250), (0, 0, 0), 8)
    cv2.imwrite(str(tmp_path / "plan.png"), picture)
    problems: list[str] = []
    with served(path) as server, chromium_page(820, 1180, has_touch=True) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        page.set_input_files("#files", tmp_path / "plan.png")
        page.wait_for_selector("#underlay-made:not([hidden])")
        page.click("#reject-lines")
        drawn = Drawing(page)
        page.click("#measure")
        for place in ((1.25, 1.25), (8.75, 1.25)):  # pixels 50 and 350 of 400, 10 m wide before scaling
            page.touchscreen.tap(*drawn.pixels(*place))
        page.fill("#known-m", "6,0")
        page.fill("#known-deg", "90")
        page.press("#known-deg", "Enter")
        page.click("#origin")
        page.touchscreen.tap(*drawn.pixels(1.25, 1.25))
        page.click("summary")
        place = {name: float(page.input_value(f"#underlay-{name}")) for name in ("x_m", "y_m", "turned_deg", "width_m")}
        assert place == pytest.approx({"x_m": 1.0, "y_m": -1.0, "turned_deg": 90.0, "width_m": 8.0}, abs=0.03)

        drawn.tool("wall")
        page.evaluate("window.scrollTo(0, 0)")
        before = (page.get_attribute("#plan", "viewBox") or "").split()
        x, y = drawn.pixels(-2.0, 3.0)
        apart = [60 + 10 * step for step in range(8)]
        dragged_by_fingers(page, [(x - far, y) for far in apart], [(x + far, y) for far in apart])
        page.wait_for_function(
            "width => document.querySelector('#plan').viewBox.baseVal.width < width * 0.6", arg=float(before[2])
        )
        assert page.locator(".p-draft").count() == 0, "the first of two fingers draws nothing"
        page.click("#fit")
        (x0, y0), (x1, y1) = drawn.pixels(0, 0), drawn.pixels(0, 6)
        dragged_by_fingers(page, [(x0 + (x1 - x0) * share / 4, y0 + (y1 - y0) * share / 4) for share in range(5)])
        page.keyboard.press("Escape")
        drawn.tool("table")
        page.touchscreen.tap(*drawn.pixels(-2, 3))
        drawn.tool("select")
        page.get_by_role("button", name="Use a polygon outline").click()
        page.evaluate("window.scrollTo(0, 0)")
        handle = box_of(page, "[data-handle='footprint 2 new']")
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        dragged_by_fingers(page, [(x - 10 * step, y) for step in range(6)])
        page.click("#save")
        page.get_by_text("drawn.yaml: saved").wait_for()
        site = SiteDocument.of(path.read_text(encoding="utf-8"), "drawn.yaml").as_json()
        (wall,), (table,) = site["walls"], site["objects"]
        assert [*wall["start"], *wall["end"]] == pytest.approx([0, 0, 0, 6], abs=0.06)
        assert len(table["footprint"]) == 5
        assert table["size_m"][0] > 0.9, "the box contains the outline"
    with served(path) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        page.click("summary")
        assert {name: float(page.input_value(f"#underlay-{name}")) for name in place} == place
        assert page.locator("#plan image").count() == 1
    assert problems == []


@pytest.mark.browser
def test_a_wall_is_drawn_moved_undone_and_saved_by_keyboard(tmp_path: Path) -> None:
    path = tmp_path / "drawn.yaml"
    with served(path) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        focused = "document.activeElement.dataset.tool"
        while page.evaluate(focused) != "wall":
            page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        box, plan = box_of(page, ".p-wall.p-selected"), box_of(page, "#plan")
        assert box["height"] < plan["height"] / 10, "the selected wall is highlighted, not covered"
        there = float(page.input_value("#field-start-x-m"))
        for key in ("ArrowRight", "ArrowRight", "Control+z", "Control+s"):
            page.keyboard.press(key)
        page.get_by_text("drawn.yaml: saved").wait_for()
    (wall,) = SiteDocument.of(path.read_text(encoding="utf-8"), "drawn.yaml").as_json()["walls"]
    assert wall["start"][0] == pytest.approx(there + 0.05)


WALLS = """
name: plan
title: Two walls
rooms: []
walls:
  - { start: [0, 0], end: [6, 0] }
  - { start: [4.08, 3.08], end: [4.08, 5] }
starts: []
"""


@contextmanager
def plan_of_two_walls(tmp_path: Path) -> Iterator[tuple[Page, Drawing, Path]]:
    """A wall along the x axis, and another that ends off the grid at (4.08, 3.08)."""
    path = tmp_path / "plan.yaml"
    path.write_text(WALLS, encoding="utf-8")
    with served(path) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        yield page, Drawing(page), path


def saved(page: Page, path: Path) -> dict[str, list[dict[str, Any]]]:
    page.click("#save")
    page.get_by_text("plan.yaml: saved").wait_for()
    site: dict[str, list[dict[str, Any]]] = SiteDocument.of(path.read_text(encoding="utf-8"), path.name).as_json()
    return site


def steps_of_5_cm(value: float) -> float:
    return abs(value / 0.05 - round(value / 0.05))


@pytest.mark.browser
def test_corners_snap_to_straight_lines_walls_and_the_grid(tmp_path: Path) -> None:
    with plan_of_two_walls(tmp_path) as (page, drawn, path):
        drawn.tool("room")
        # Along the first wall, then near the end of the second, which is 8 cm off the straight line.
        drawn.click((1.02, 0.03), (1.04, 3.02), (4.05, 3.04), (4.03, 0.04))
        page.keyboard.press("Enter")
        (room,) = saved(page, path)["rooms"]
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = room["polygon"]
    assert (x0, y0) == pytest.approx((1.0, 0.0)), "on the grid along the wall"
    assert (x1, y2, x3) == pytest.approx((x0, y1, x2)), "straight"
    assert y1 == pytest.approx(3.0)
    assert x2 == pytest.approx(4.08), "as far as the end of the wall"
    assert y3 == pytest.approx(0.0), "as far as the wall that it crosses"


@pytest.mark.browser
def test_a_door_and_its_ends_snap_to_the_grid_along_their_wall(tmp_path: Path) -> None:
    with plan_of_two_walls(tmp_path) as (page, drawn, path):
        drawn.tool("door")
        drawn.click((2.03, 0.02))
        drawn.tool("select")
        page.mouse.move(*drawn.pixels(*opening_end(page)))
        page.mouse.down()
        page.mouse.move(*drawn.pixels(3.02, 0.1), steps=4)
        page.mouse.up()
        (door,) = saved(page, path)["doors"]
    assert door["start"] == pytest.approx([1.65, 0.0])
    assert door["end"] == pytest.approx([3.0, 0.0])


@pytest.mark.browser
def test_alt_suspends_snapping(tmp_path: Path) -> None:
    with plan_of_two_walls(tmp_path) as (page, drawn, path):
        drawn.tool("wall")
        drawn.click((1.02, 1.53), (4.11, 3.05))
        page.keyboard.press("Escape")
        drawn.tool("wall")
        page.keyboard.down("Alt")
        drawn.click((1.02, 1.03), (4.11, 3.05))
        page.keyboard.up("Alt")
        wall_snapped, wall_free = saved(page, path)["walls"][2:]
    assert [*wall_free["start"], *wall_free["end"]] == pytest.approx([1.02, 1.03, 4.11, 3.05], abs=0.015)
    assert max(map(steps_of_5_cm, [*wall_free["start"], *wall_free["end"]])) > 0.1
    assert [*wall_snapped["start"], *wall_snapped["end"]] == pytest.approx([1.0, 1.55, 4.08, 3.08])


@pytest.mark.browser
def test_a_room_corner_can_be_dragged_a_short_distance(tmp_path: Path) -> None:
    with plan_of_two_walls(tmp_path) as (page, drawn, path):
        drawn.tool("room")
        drawn.click((1, 1), (3, 1), (3, 2.5), (1, 2.5))
        page.keyboard.press("Enter")
        drawn.tool("select")
        page.mouse.move(*drawn.pixels(1, 1))
        page.mouse.down()
        page.mouse.move(*drawn.pixels(0.9, 0.95), steps=3)
        page.mouse.up()
        (room,) = saved(page, path)["rooms"]
    assert room["polygon"][0] == pytest.approx([0.9, 0.95])


def opening_end(page: Page) -> tuple[float, float]:
    """Return the end of the selected door, from its fields."""
    x, y = (float(page.input_value(f"#field-end-{axis}-m")) for axis in ("x", "y"))
    return x, y


@pytest.mark.browser
def test_the_page_is_accessible(site_file: Path) -> None:
    underlay = Underlay.of_grid(map_of_site(load_site(FLAT)), "map.yaml")
    with served(site_file, underlay) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        page.click("summary")
        assert accessibility_findings(page) == []
        fields = [page.get_by_label(label, exact=True) for label in ("ceiling height, m", "survey error, m")]
        assert len({box_of(page, f"#{field.get_attribute('id')}")["y"] for field in fields}) == 1, "in one row"
