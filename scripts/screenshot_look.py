"""Saves docs/figures/browse-gallery.png, browse-pair.png (two episodes of a trial) and video-frame.jpg.

usage: python scripts/screenshot_look.py RESULTS EPISODE EPISODE   (from the top of the checkout)
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import av
from playwright.sync_api import sync_playwright

CHROMIUM = "/usr/bin/chromium"
FIGURES = Path("docs/figures")


def main(results: str, first: str, second: str) -> None:
    """Write the figures."""
    vsnbench = [sys.executable, "-m", "vsnbench"]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "episode.mp4")
        subprocess.run([*vsnbench, "export", "video", first, "-o", str(file), "--results", results], check=True)
        with av.open(str(file)) as video:
            frames = [frame.to_image() for frame in video.decode(video=0)]
        frames[len(frames) // 2].save(FIGURES / "video-frame.jpg", quality=85)
    server = subprocess.Popen(
        [*vsnbench, "browse", "--port", "0", "--results", results], stdout=subprocess.PIPE, text=True
    )
    assert server.stdout is not None
    try:
        address = server.stdout.readline().strip()
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=("--no-sandbox",))
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(address)
            page.wait_for_selector(".tile .plan svg")
            page.wait_for_timeout(2000)
            page.screenshot(path=str(FIGURES / "browse-gallery.png"))
            page.goto(f"{address.partition('?')[0]}#/compare/{first}/{second}")
            page.wait_for_selector(".two .plan svg")
            page.keyboard.press("End")
            page.wait_for_timeout(2000)
            page.screenshot(path=str(FIGURES / "browse-pair.png"))
            browser.close()
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
