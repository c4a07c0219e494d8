"""The site editor as a browser has it: over HTTP, and drawn in with mouse and keyboard."""

import base64
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from tests.console.browser import Browser
from vsnbench.console.plan_underlay import Underlay
from vsnbench.console.session_key import SessionKey
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


@pytest.mark.browser
def test_everybody_can_read_the_page(site_file: Path) -> None:
    with served(site_file) as server, chromium_page(1280, 800) as page:
        page.set_default_timeout(PATIENCE_MS)
        page.goto(server.addresses[0])
        page.wait_for_selector("body[data-open=yes]")
        assert accessibility_findings(page) == []
