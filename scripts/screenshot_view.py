"""Saves docs/figures/episode-view.png: an episode in Rerun's web viewer, in headless Chromium.

usage: python scripts/screenshot_view.py RESULTS EPISODE PNG   (from the top of the checkout)
"""

import sys
import time
from pathlib import Path

from playwright.sync_api import sync_playwright

from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.viewer.rebuild import current_recording
from vsnbench.viewer.web_viewer import WebViewer

CHROMIUM = "/usr/bin/chromium"
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage")
STILL_FOR_S = 12.0
PATIENCE_S = 120.0


def main(results: str, episode: str, png: str) -> None:
    """Save a screenshot of the viewer once the page no longer changes."""
    recording = current_recording(ResultsDirectory.locate(Path(results)), int(episode))
    with WebViewer(0, recording) as viewer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1600, "height": 1000})
        page.goto(f"{viewer.address}&renderer=webgl", timeout=PATIENCE_S * 1000)
        began = changed = time.monotonic()
        picture = b""
        while time.monotonic() - changed < STILL_FOR_S and time.monotonic() - began < PATIENCE_S:
            page.wait_for_timeout(1000)
            if (now := page.screenshot(timeout=PATIENCE_S * 1000)) != picture:
                picture, changed = now, time.monotonic()
        browser.close()
    Path(png).write_bytes(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
