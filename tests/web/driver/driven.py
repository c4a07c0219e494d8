"""A run that a person drives through the page, with a client of HTTP in place of the browser."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from tests.processes import wait_until
from tests.web.browser import Browser
from vsnbench.models.human.controls import Controls
from vsnbench.web.driver.page import DriverPage


def entered(address: str) -> Browser:
    """Return a browser that has opened the page."""
    browser = Browser(address).enter()
    browser.csrf_token = browser.ask("GET", "/state").json["csrf_token"]
    return browser


@dataclass
class Driver:
    """Takes the controls of each trial, and answers its pictures with the actions of a list."""

    actions: Sequence[str]
    states: list[dict[str, Any]] = field(default_factory=list)
    """Everything that the page was told."""
    pictures: list[bytes] = field(default_factory=list)

    @contextmanager
    def serve(self, controls: Controls) -> Iterator[str]:
        """Serve the page on a free port, and drive on it."""
        with replace(DriverPage(), port=0).serve(controls) as text:
            thread = threading.Thread(target=self._drive, args=(text.split()[-1],), daemon=True)
            thread.start()
            yield text

    def _drive(self, address: str) -> None:
        browser, left = entered(address), list(self.actions)
        while left:
            state: dict[str, Any] = {}

            def is_asked(state: dict[str, Any] = state) -> bool:
                state.update(browser.ask("GET", "/state").json)
                return state["phase"] in ("ready", "choosing")

            wait_until(is_asked, "a trial or a picture")
            self.states.append(state)
            if state["phase"] == "ready":
                assert browser.post("/take").status == 200
                continue
            self.pictures.append(browser.ask("GET", "/picture").body)
            assert browser.post("/choose", picture=state["picture"], action=left.pop(0)).status == 200
