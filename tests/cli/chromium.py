"""The distribution's Chromium with a single page, driven by Playwright."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

EXECUTABLE = "/usr/bin/chromium"
FLAGS = ("--no-sandbox", "--disable-dev-shm-usage")
"""Chromium has no sandbox for root."""
WITHOUT_WEBGL = ("--disable-gpu",)
"""Drawing through a GPU that software emulates takes half as much processor time again."""
WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@contextmanager
def chromium(*, webgl: bool = False) -> Iterator[Browser]:
    """Open a headless browser."""
    flags = [*FLAGS, *(WEBGL if webgl else WITHOUT_WEBGL)]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=EXECUTABLE, args=flags)
        try:
            yield browser
        finally:
            browser.close()


_keeper: list[ExitStack] = []
_kept: list[Browser] = []


@contextmanager
def one_chromium() -> Iterator[None]:
    """Open the pages of this block in a single browser, which starts with the first: a start takes a second."""
    with ExitStack() as stack:
        _keeper.append(stack)
        try:
            yield
        finally:
            _keeper.clear()
            _kept.clear()


@contextmanager
def chromium_page(width: int, height: int, **options: Any) -> Iterator[Page]:
    """Open a headless browser on an empty page of a size in pixels; `options` are Playwright's for a new page."""
    with ExitStack() as stack:
        if _keeper and not _kept:
            _kept.append(_keeper[0].enter_context(chromium()))
        browser = _kept[0] if _kept else stack.enter_context(chromium())
        page = browser.new_page(viewport={"width": width, "height": height}, **options)
        try:
            yield page
        finally:
            page.close()
