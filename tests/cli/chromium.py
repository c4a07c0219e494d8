"""The distribution's Chromium with a single page, driven by Playwright."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

EXECUTABLE = "/usr/bin/chromium"
FLAGS = (
    "--no-sandbox",  # Chromium has no sandbox for root
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
)


@contextmanager
def chromium() -> Iterator[Browser]:
    """Open a headless browser."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def chromium_page(width: int, height: int, **options: Any) -> Iterator[Page]:
    """Open a headless browser on an empty page of a size in pixels; `options` are Playwright's for a new page."""
    with chromium() as browser:
        yield browser.new_page(viewport={"width": width, "height": height}, **options)
