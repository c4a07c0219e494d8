"""Saves docs/figures/report-*.png: the figures of a report, and its page.

usage: python scripts/report_figures.py RESULTS   (from the top of the checkout)

The results are those of these two commands, with --keep none:

    vsnbench run --model vlv,random --seed 0-1 --goal all
    vsnbench run --model forward,pirlnav --goal all
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

CHROMIUM = "/usr/bin/chromium"
FIGURES = Path("docs/figures")
NAMES = {
    "actions": "actions",
    "differences": "differences",
    "outcomes-over-actions": "outcomes-over-actions",
    "success-by-cell": "success-by-cell",
    "success-by-goal": "success-by-goal",
    "success-map": "success-map",
    "trajectories-1": "trajectories-vlv",
    "trajectories-2": "trajectories-random",
}
"""Figure of the report -> name in docs/figures; vlv and random are the first models."""


def save_small(picture: Path, name: str) -> None:
    """Save a picture with a palette of 256 colours, which is a third of the size."""
    with Image.open(picture) as image:
        small = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    small.save(FIGURES / f"report-{name}.png", optimize=True)


def main(results: str) -> None:
    """Write the figures and a screenshot of the page."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, "report")
        words = ["report", "--results", results, "--reference", "paper", "--output", str(output), "--quiet"]
        subprocess.run([sys.executable, "-m", "vsnbench", *words], check=True)
        for figure, name in NAMES.items():
            save_small(output / "figures" / f"{figure}.png", name)
        page_png = Path(folder, "page.png")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=("--no-sandbox",))
            page = browser.new_page(viewport={"width": 1280, "height": 1500})
            page.goto((output / "report.html").as_uri())
            page.wait_for_load_state("networkidle")
            page.screenshot(path=str(page_png))
            browser.close()
        save_small(page_png, "page")


if __name__ == "__main__":
    main(*sys.argv[1:])
