"""A served site editor, and a person who draws on its plan."""

from pathlib import Path

from playwright.sync_api import Page

from vsnbench.robots.profiles import load_profile
from vsnbench.web.site_editor.editor import MAX_BODY_BYTES, SiteEditor
from vsnbench.web.site_editor.underlay import Underlay
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey

PATIENCE_MS = 200_000


def served(path: Path, underlay: Underlay | None = None) -> WebServer:
    editor = SiteEditor(path, load_profile("turtlebot2"), underlay)
    return WebServer(editor.app(), SessionKey.new(), max_body_bytes=MAX_BODY_BYTES)


class Drawing:
    """Draws on the page at places given in metres."""

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
