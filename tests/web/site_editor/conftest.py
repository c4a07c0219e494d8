"""Fixtures of the site editor's tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.chromium import one_chromium
from tests.web.browser import Browser
from tests.web.site_editor.drawing import served


@pytest.fixture(scope="module", autouse=True)
def browser_of_the_module() -> Iterator[None]:
    with one_chromium():
        yield


@pytest.fixture
def browser(site_file: Path) -> Iterator[Browser]:
    """Return a client of the editor of the module's `site_file`."""
    with served(site_file) as server:
        entered = Browser(server.addresses[0], timeout_s=200.0).enter()
        entered.csrf_token = entered.ask("GET", "/state").json["csrf_token"]
        yield entered
