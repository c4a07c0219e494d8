"""Fixtures of the site editor's tests."""

from collections.abc import Iterator

import pytest

from tests.cli.chromium import one_chromium


@pytest.fixture(scope="module", autouse=True)
def browser_of_the_module() -> Iterator[None]:
    with one_chromium():
        yield
