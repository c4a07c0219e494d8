"""The site editor as a browser has it: over HTTP, and drawn in with mouse and keyboard."""

import base64
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.console.browser import Browser
from vsnbench.console.plan_underlay import Underlay
from vsnbench.console.session_key import SessionKey
from vsnbench.console.site_document import SiteDocument
from vsnbench.console.site_editor import MOST_BODY_BYTES, SiteEditor
from vsnbench.console.web_server import WebServer
from vsnbench.exchange.ros_map import write_ros_map
from vsnbench.exchange.site_map import map_of_site
from vsnbench.protocol.site import load_site
from vsnbench.robots.profiles import load_profile

FLAT = Path(__file__).parents[1] / "protocol" / "survey" / "flat.yaml"
PATIENCE_MS = 200_000


@pytest.fixture
def site_file(tmp_path: Path) -> Path:
    path = tmp_path / "flat.yaml"
    path.write_bytes(FLAT.read_bytes())
    return path


def served(path: Path, underlay: Underlay | None = None) -> WebServer:
    editor = SiteEditor(path, load_profile("turtlebot2"), underlay)
    return WebServer(editor.app(), SessionKey.new(), most_body_bytes=MOST_BODY_BYTES)


@pytest.fixture
def browser(site_file: Path) -> Iterator[Browser]:
    with served(site_file) as server:
        entered = Browser(server.addresses[0], timeout_s=200.0).enter()
        entered.proof = entered.ask("GET", "/state").json["proof"]
        yield entered


def test_findings_are_those_of_the_check(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    assert browser.post("/check", site=site).json == {"findings": []}
    del site["walls"][4]
    codes = [finding["code"] for finding in browser.post("/check", site=site).json["findings"]]
    assert "edge-without-wall" in codes
    site["starts"][0]["heading_deg"] = "north"
    (finding,) = browser.post("/check", site=site).json["findings"]
    assert finding["code"] == "format"
    assert finding["entries"] == [["starts", 0]]


def test_a_save_keeps_the_comments_and_goes_on_from_there(browser: Browser, site_file: Path) -> None:
    site = browser.ask("GET", "/state").json["site"]
    site["title"] = "A flat"
    site = browser.post("/save", site=site).json["site"]
    site["title"] = "Our flat"
    assert browser.post("/save", site=site).status == 200
    text = site_file.read_text(encoding="utf-8")
    assert text.startswith("# A sound flat of two rooms")
    assert load_site(site_file).title == "Our flat"


def test_a_look_is_a_jpeg_of_the_simulator(browser: Browser) -> None:
    site = browser.ask("GET", "/state").json["site"]
    look = browser.post("/look", site=site, x_m=2.5, y_m=2.2, heading_deg=90)
    assert look.headers["content-type"] == "image/jpeg"
    assert look.body.startswith(b"\xff\xd8")


@pytest.mark.parametrize(
    ("path", "said", "status"),
    [
        ("/check", {}, 400),
        ("/check", {"site": {"walls": [3]}}, 400),
        ("/look", {"site": {}, "x_m": "a", "y_m": 1, "heading_deg": 0}, 400),
        ("/look", {"site": {}, "x_m": 1, "y_m": 1, "heading_deg": 0}, 409),
        ("/underlay", {"image": "*"}, 400),
        ("/underlay", {"image": base64.b64encode(b"no picture").decode()}, 409),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(
    browser: Browser, path: str, said: dict[str, object], status: int
) -> None:
    answer = browser.post(path, **said)
    assert answer.status == status
    assert answer.json["words"]


class Drawn:
    """Draws in the page at places given in metres."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def pixels(self, x_m: float, y_m: float) -> tuple[float, float]:
        plan = self.page.locator("#plan")
        left, top, width, height = (float(part) for part in (plan.get_attribute("viewBox") or "").split())
        box = plan.bounding_box()
        assert box is not None
        scale = max(width / box["width"], height / box["height"])
        x = box["x"] + box["width"] / 2 + (x_m - left - width / 2) / scale
        y = box["y"] + box["height"] / 2 + (-y_m - top - height / 2) / scale
        return x, y

    def tool(self, name: str) -> None:
        self.page.locator(f"#tools [data-tool={name}]").click()

    def click(self, *places: tuple[float, float]) -> None:
        for place in places:
            self.page.mouse.click(*self.pixels(*place))

    def field(self, name: str, value: str) -> None:
        field = self.page.locator(f"#field-{name}")
        field.fill(value)
        field.press("Enter")


def box_of(page: Page, selector: str) -> dict[str, float]:
    """Return where something is drawn, as soon as it is: the plan is drawn anew with every change."""
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
@pytest.mark.slow
def test_a_flat_is_drawn_from_a_robots_map_with_mouse_and_keyboard(tmp_path: Path) -> None:
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
        drawn = Drawn(page)
        page.click("#accept-lines")
        drawn.tool("room")
        drawn.click((0, 0), (4, 0), (4, 5), (0, 5))
        page.keyboard.press("Enter")
        drawn.field("name", "hall")
        drawn.click((4, 0), (6, 0), (6, 5), (4, 5))  # from a corner of the one that is chosen
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
    assert [door.clear_width_m for door in site.doors] == [pytest.approx(0.8, abs=0.06)]
    assert site.starts[0].heading_deg == 90
    (sofa,) = site.objects
    assert (sofa.position[0], sofa.heading_deg) == (1.5, 15)


def dragged_by_fingers(page: Page, *ways: list[tuple[float, float]]) -> None:
    """Put a finger down at the first point of each way, move them along together, and lift them."""
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
@pytest.mark.slow
def test_on_a_tablet_a_picture_is_scaled_and_found_again_and_fingers_draw_and_pinch(tmp_path: Path) -> None:
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
        drawn = Drawn(page)
        page.click("#measure")
        for place in ((1.25, 1.25), (8.75, 1.25)):  # pixels 50 and 350 of 400, which are 10 m until they are scaled
            page.touchscreen.tap(*drawn.pixels(*place))
        page.fill("#known-m", "6,0")
        page.fill("#known-deg", "90")
        page.press("#known-deg", "Enter")
        page.click("#origin")
        page.touchscreen.tap(*drawn.pixels(1.25, 1.25))
        page.click("summary")
        lies = {name: float(page.input_value(f"#underlay-{name}")) for name in ("x_m", "y_m", "turned_deg", "width_m")}
        assert lies == pytest.approx({"x_m": 1.0, "y_m": -1.0, "turned_deg": 90.0, "width_m": 8.0}, abs=0.03)

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
        drawn.tool("choose")
        page.get_by_role("button", name="Outline it as a polygon").click()
        page.evaluate("window.scrollTo(0, 0)")
        handle = box_of(page, "[data-handle='footprint 2 new']")
        x, y = handle["x"] + handle["width"] / 2, handle["y"] + handle["height"] / 2
        dragged_by_fingers(page, [(x - 10 * step, y) for step in range(6)])
        page.click("#save")
        page.get_by_text("drawn.yaml: saved").wait_for()
        site = SiteDocument.of(path.read_text(encoding="utf-8"), "drawn.yaml").for_page()
        (wall,), (table,) = site["walls"], site["objects"]
        assert [*wall["start"], *wall["end"]] == pytest.approx([0, 0, 0, 6], abs=0.06)
        assert len(table["footprint"]) == 5
        assert table["size_m"][0] > 0.9, "the look is as large as the outline"
    with served(path) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        page.click("summary")
        assert {name: float(page.input_value(f"#underlay-{name}")) for name in lies} == lies
        assert page.locator("#plan image").count() == 1
    assert problems == []


@pytest.mark.browser
def test_by_keyboard_alone_a_wall_is_drawn_moved_undone_and_saved(tmp_path: Path) -> None:
    path = tmp_path / "drawn.yaml"
    with served(path) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        focused = "document.activeElement.dataset.tool"
        while page.evaluate(focused) != "wall":
            page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        box, plan = box_of(page, ".p-wall.p-chosen"), box_of(page, "#plan")
        assert box["height"] < plan["height"] / 10, "what is chosen is marked, not covered"
        there = float(page.input_value("#field-start-x-m"))
        for key in ("ArrowRight", "ArrowRight", "Control+z", "Control+s"):
            page.keyboard.press(key)
        page.get_by_text("drawn.yaml: saved").wait_for()
    (wall,) = SiteDocument.of(path.read_text(encoding="utf-8"), "drawn.yaml").for_page()["walls"]
    assert wall["start"][0] == pytest.approx(there + 0.05)


@pytest.mark.browser
def test_everybody_can_read_the_page(site_file: Path) -> None:
    below = Underlay.of_grid(map_of_site(load_site(FLAT)), "map.yaml")
    with served(site_file, below) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        page.click("summary")
        assert accessibility_findings(page) == []
        fields = [page.get_by_label(label, exact=True) for label in ("ceiling height, m", "survey error, m")]
        assert len({box_of(page, f"#{field.get_attribute('id')}")["y"] for field in fields}) == 1, "beside each other"
