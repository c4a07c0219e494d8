"""Measures the gallery of `vsnbench browse` on 10,000 episodes, in Chromium.

    python benchmarks/gallery_scale.py --directory /var/tmp/gallery      makes the record once, measures

The record is that of `report_scale.py`, without images. Measured are the time from opening the page to the first cards,
and to their plans; and the time of a filter, a search and another grouping until their cards are laid out. The page is
opened after `--settled` seconds, in which the server reads the list; `--settled 0` includes that.
"""

import argparse
import time
from contextlib import closing
from pathlib import Path
from statistics import median

from playwright.sync_api import Page, sync_playwright

from benchmarks.report_scale import make_record
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.web.results_browser.app import BrowserApp
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey

FLAGS = ("--no-sandbox", "--disable-gpu")
CHANGES = {
    "filter": ("#/?model=vlv&outcome=failure", "#/"),
    "search": ("#/?q=pirlnav+chair", "#/?q=plant"),
    "grouping": ("#/?group=goal", "#/?group=model"),
}
_TIMED = """(address) => {
  const began = performance.now();
  const { chosen, view } = route(address);
  list?.close();
  drawResults(chosen, view);
  document.body.getBoundingClientRect();
  return performance.now() - began;
}"""
"""What a change of the address calls, with the layout."""


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--episodes", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--settled", type=float, default=20.0)
    given = parser.parse_args()
    if not (given.directory / "vsnbench.db").exists():
        make_record(given.directory, given.episodes)
    results = ResultsDirectory.locate(given.directory, None)
    with (
        open_record(results.database_url) as engine,
        closing(BrowserApp(results, engine)) as app,
        sync_playwright() as playwright,
    ):
        app.prepare()
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        with WebServer(app.routes(), SessionKey.new()) as server:
            time.sleep(given.settled)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(server.addresses[0])
            address = page.url.partition("#")[0]
            print_times("first cards, ms", [opened(page, address, ".tile") for _ in range(given.runs)])
            print_times("their plans, ms", [opened(page, address, ".tile .plan svg") for _ in range(given.runs)])
            for name, changes in CHANGES.items():
                times = [page.evaluate(_TIMED, address) for _ in range(given.runs) for address in changes]
                print_times(f"{name}, ms", times)
        browser.close()


def opened(page: Page, address: str, selector: str) -> float:
    """Return the time from opening the page until an element is there, milliseconds."""
    page.goto("about:blank")
    began = time.perf_counter()
    page.goto(address, wait_until="commit")
    page.wait_for_selector(selector)
    return 1000 * (time.perf_counter() - began)


def print_times(name: str, times: list[float]) -> None:
    """Print the median and the range."""
    print(f"{name}: median {median(times):.0f}, {min(times):.0f} to {max(times):.0f} ({len(times)} runs)")


if __name__ == "__main__":
    main()
