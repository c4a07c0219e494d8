"""Draws a flat of eight rooms in the site editor and counts clicks and keys.

usage: python scripts/draw_eight_rooms.py OUTPUT.yaml [--flat scripts/eight_rooms.yaml]

The underlay is a map of the flat (`sites export --map`). The script traces walls, clicks doors and windows, and places
furniture and starts with typed coordinates. It prints the elapsed time, and an estimate for an experienced person by
the keystroke-level model (Card, Moran and Newell 1980): 1.1 s to point, 0.2 s to click, 0.28 s per key, 0.4 s to change
between mouse and keyboard, 1.35 s to think before each element. The estimate does not include measuring the flat.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, sync_playwright

from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import Site, SiteObject, load_site
from vsnbench.web.site_editor.editor import MAX_BODY_BYTES, SiteEditor
from vsnbench.web.site_editor.underlay import Underlay
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey

Point = tuple[float, float]
POINT_S, CLICK_S, KEY_S, HAND_S, THINK_S = 1.1, 0.2, 0.28, 0.4, 1.35
PATIENCE_MS = 240_000


@dataclass
class Effort:
    """Counts of actions for the keystroke-level model."""

    clicks: int = 0
    keys: int = 0
    elements: int = 0
    hands: int = 0

    @property
    def minutes(self) -> float:
        """Estimated time of a person."""
        seconds = self.clicks * (POINT_S + CLICK_S) + self.keys * KEY_S + self.hands * HAND_S + self.elements * THINK_S
        return seconds / 60


class Drawing:
    """Draws on the page and counts the actions."""

    def __init__(self, page: Page) -> None:
        self.page, self.effort = page, Effort()

    def pixels(self, at: Point) -> Point:
        """Return the screen position of a point of the plan."""
        plan = self.page.locator("#plan")
        left, top, width, height = (float(part) for part in (plan.get_attribute("viewBox") or "").split())
        box = plan.bounding_box()
        if box is None:
            raise SystemExit("the page shows no plan")
        scale = max(width / box["width"], height / box["height"])
        x = box["x"] + box["width"] / 2 + (at[0] - left - width / 2) / scale
        return x, box["y"] + box["height"] / 2 + (-at[1] - top - height / 2) / scale

    def tool(self, name: str) -> None:
        """Select a tool."""
        self.press(f"#tools [data-tool={name}]")

    def press(self, selector: str) -> None:
        """Click an element of the page."""
        self.page.click(selector)
        self.effort.clicks += 1

    def click(self, *places: Point) -> None:
        """Click points of the plan."""
        for place in places:
            self.page.mouse.click(*self.pixels(place))
            self.effort.clicks += 1

    def key(self, name: str) -> None:
        """Press a key."""
        self.page.keyboard.press(name)
        self.effort.keys += 1
        self.effort.hands += 2

    def type(self, field: str, value: Any, shown: Any = None) -> None:
        """Type the value of a field, if it differs."""
        words = f"{value:g}" if isinstance(value, int | float) else str(value)
        entry = self.page.locator(f"#field-{field}")
        if entry.input_value() in (words, str(shown)):
            return
        entry.fill(words)
        entry.press("Enter")
        self.effort.clicks += 1
        self.effort.keys += len(words) + 1
        self.effort.hands += 2

    def choose(self, field: str, value: str) -> None:
        """Select the value of a field from its list."""
        self.page.select_option(f"#field-{field}", value)
        self.effort.clicks += 2

    def draw(self, flat: Site) -> None:
        """Draw all elements of a flat."""
        self.press("#reject-lines")  # the script traces the walls itself
        for wall in flat.walls:
            self.effort.elements += 1
            self.tool("wall")
            self.click(wall.start, wall.end)
            self.key("Escape")
        for room in flat.rooms:
            self.effort.elements += 1
            self.tool("room")
            self.click(*room.polygon)
            self.key("Enter")
            self.type("name", room.name)
            if room.floor != "wood":
                self.choose("floor", room.floor)
        for kind, openings in (("door", flat.doors), ("window", flat.windows)):
            for opening in openings:
                self.effort.elements += 1
                self.tool(kind)
                (x0, y0), (x1, y1) = opening.start, opening.end
                self.click(((x0 + x1) / 2, (y0 + y1) / 2))
                if kind == "door":
                    self.type("name", opening.name)  # type: ignore[union-attr]
                if getattr(opening, "closed", False):
                    self.choose("closed", "yes")
        for item in flat.objects:
            self.effort.elements += 1
            self.place(item)
        for start in flat.starts:
            self.effort.elements += 1
            self.tool("start")
            self.click(start.position)
            self.type("x-m", start.position[0])
            self.type("y-m", start.position[1])
            self.type("heading_deg", start.heading_deg)

    def place(self, item: SiteObject) -> None:
        """Place an object and type its numbers."""
        self.tool(item.category)
        self.click(item.position)
        for name, value in (
            ("x-m", item.position[0]),
            ("y-m", item.position[1]),
            ("heading_deg", item.heading_deg),
            *zip(("depth-m", "width-m", "height-m"), item.size_m, strict=True),
            ("elevation_m", item.elevation_m),
        ):
            self.type(name, value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    parser.add_argument("--flat", type=Path, default=Path(__file__).with_name("eight_rooms.yaml"))
    parser.add_argument("--picture", type=Path, help="write a screenshot of the page at the end")
    asked = parser.parse_args()
    if asked.output.exists():
        raise SystemExit(f"{asked.output} already exists")
    vsnbench = [sys.executable, "-m", "vsnbench.cli.main"]
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder) / "map.yaml"
        subprocess.run([*vsnbench, "sites", "export", str(asked.flat), "--map", str(path)], check=True)
        editor = SiteEditor(asked.output, load_profile("turtlebot2"), Underlay.of_file(path))
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        with WebServer(editor.app(), SessionKey.new(), max_body_bytes=MAX_BODY_BYTES) as server:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(PATIENCE_MS)
            page.goto(server.addresses[0])
            page.wait_for_selector("body[data-open=yes]")
            drawing, began_s = Drawing(page), time.monotonic()
            drawing.draw(load_site(asked.flat))
            drawing.press("#save")
            page.get_by_text(": saved", exact=False).first.wait_for()
            took_s = time.monotonic() - began_s
            if asked.picture:
                page.screenshot(path=asked.picture)
        browser.close()
    done = drawing.effort
    print(f"{done.elements} elements, {done.clicks} clicks, {done.keys} keys: {took_s / 60:.1f} min elapsed")
    print(f"an experienced person: about {done.minutes:.0f} min by the keystroke-level model")
    typed = len("".join(line for line in asked.flat.read_text(encoding="utf-8").splitlines()))
    print(f"as YAML: {typed} characters, {typed * KEY_S / 60:.0f} min of typing at the same speed")
    sys.exit(subprocess.run([*vsnbench, "sites", "check", str(asked.output)], check=False).returncode)


if __name__ == "__main__":
    main()
