"""Saves docs/figures/report-*.png: the figures of a report; of another, its page and the trajectories of random.

usage: python scripts/report_figures.py RESULTS SMALL   (from the top of the checkout)

RESULTS are those of the first two commands, with --keep none, and SMALL those of the third:

    vsnbench run --model vlv,random --seed 0-1 --goal all
    vsnbench run --model forward,pirlnav --goal all
    vsnbench run --model pirlnav,random --goal chair
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
}
"""Figure of the report -> name in docs/figures; vlv is the first model."""


def save_small(picture: Path, name: str) -> None:
    """Save a picture with a palette of 256 colours, which is a third of the size."""
    with Image.open(picture) as image:
        small = image.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    small.save(FIGURES / f"report-{name}.png", optimize=True)


def write(results: str, output: Path, *words: str) -> Path:
    """Write a report into a directory, and return that of its figures."""
    command = [sys.executable, "-m", "vsnbench", "report", "--results", results, "--output", str(output), "--quiet"]
    subprocess.run([*command, *words], check=True)
    return output / "figures"


def main(results: str, small: str) -> None:
    """Write the figures and a screenshot of the page."""
    with tempfile.TemporaryDirectory() as folder:
        figures = write(results, Path(folder, "report"), "--reference", "paper")
        for figure, name in NAMES.items():
            save_small(figures / f"{figure}.png", name)
        figures = write(small, Path(folder, "small"))
        save_small(figures / "trajectories-2.png", "trajectories-random")
        page_png = Path(folder, "page.png")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=("--no-sandbox",))
            page = browser.new_page(viewport={"width": 1280, "height": 1500})
            page.goto((figures.parent / "report.html").as_uri())
            page.wait_for_load_state("networkidle")
            page.screenshot(path=str(page_png))
            browser.close()
        save_small(page_png, "page")


if __name__ == "__main__":
    main(*sys.argv[1:])
