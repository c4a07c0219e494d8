"""Measures `vsnbench browse` on a large record in Chromium: first page, filters, scrolling, the server's memory.

    python benchmarks/browse_scale.py --directory /var/tmp/browse-10000 [--episodes 10000]

The record is synthetic and has no images: `make_record` of `report_scale.py` writes it with SQL on the first run.
"""

import argparse
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import psutil
from playwright.sync_api import Page

sys.path.insert(0, str(Path(__file__).parents[1]))
from benchmarks.report_scale import make_record
from tests.cli.chromium import chromium

FILTERS = ({"goal": "toilet"}, {"model": "vlv"}, {"outcome": "failure"}, {"goal": "chair", "model": "pirlnav"}, {})
_FILTERED_MS = """(wanted) => new Promise((resolve) => {
  const address = "#/?" + new URLSearchParams(wanted), began = performance.now();
  const before = document.getElementById("count");
  const wait = () => document.getElementById("count") !== before
    ? requestAnimationFrame(() => resolve(performance.now() - began)) : setTimeout(wait, 1);
  location.hash = location.hash === address ? address + "&view=list" : address;
  wait();
})"""
_SCROLL_MS = """() => new Promise((resolve) => {
  const gaps = []; let last = performance.now(), place = 0;
  const step = () => {
    const now = performance.now(); gaps.push(now - last); last = now; place += 4000;
    if (place > document.documentElement.scrollHeight) return resolve(gaps.sort((a, b) => a - b));
    scrollTo(0, place); requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
})"""


def main() -> None:
    """Print the measurements as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--episodes", type=int, default=10_000)
    arguments = parser.parse_args()
    if not (arguments.directory / "vsnbench.db").exists():
        make_record(arguments.directory, arguments.episodes)
    command = [sys.executable, "-m", "vsnbench", "browse", "--port", "0", "--results", str(arguments.directory)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    try:
        print(json.dumps(measure(server.stdout.readline().strip(), psutil.Process(server.pid)), indent=2))
    finally:
        server.send_signal(signal.SIGINT)
        server.wait()


def measure(address: str, server: psutil.Process) -> dict[str, Any]:
    """Return times in milliseconds and sizes in MiB."""
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        first_ms = opened_ms(page, address)
        again_ms = opened_ms(page, address)
        while not json.loads(page.evaluate("fetch('data/failures.json').then((a) => a.text())"))["is_complete"]:
            time.sleep(0.5)
        classified_ms = opened_ms(page, address)
        filters = [page.evaluate(_FILTERED_MS, wanted) for wanted in FILTERS * 4]
        grid_ms = page.evaluate(_FILTERED_MS, {"view": "grid"})
        page.evaluate(_FILTERED_MS, {"view": "list"})
        gaps = page.evaluate(_SCROLL_MS)
        before_mib = server.memory_info().rss / 2**20
        for _ in range(50):
            page.reload()
            page.wait_for_selector(".rows .line")
        return {
            "first_page_ms": round(first_ms),
            "first_page_again_ms": round(again_ms),
            "first_page_with_failure_kinds_ms": round(classified_ms),
            "filter_ms_median": round(median(filters), 1),
            "filter_ms_longest": round(max(filters), 1),
            "grid_ms": round(grid_ms, 1),
            "scroll_frame_ms_median": round(median(gaps), 1),
            "scroll_frame_ms_99": round(gaps[int(len(gaps) * 0.99)], 1),
            "rows_in_document": page.evaluate("document.querySelectorAll('.rows .line').length"),
            "server_mib": round(before_mib),
            "server_mib_after_50_reloads": round(server.memory_info().rss / 2**20),
        }


def opened_ms(page: Page, address: str) -> float:
    """Return the time from entering the address until the rows are in the page."""
    began_s = time.monotonic()
    page.goto(address)
    page.wait_for_selector(".rows .line")
    return (time.monotonic() - began_s) * 1000


if __name__ == "__main__":
    main()
