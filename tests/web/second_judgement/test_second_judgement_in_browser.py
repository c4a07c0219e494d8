"""A second person judges a sample in Chromium; nothing that the browser receives reveals verdict or model."""

import json
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, Route
from statsmodels.stats.inter_rater import cohens_kappa

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium
from tests.cli.test_record_verbs import vsnbench
from tests.processes import wait_until
from tests.web.second_judgement.blind_record import TELLTALE, first_success, make_record, served
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.second_judgements import second_judgements

pytestmark = pytest.mark.browser
PHONE = (390, 844)
SAMPLE = 16


class Received:
    """Everything that a page receives and sends: addresses, headers and bodies of requests and answers."""

    def __init__(self, page: Page) -> None:
        self.parts: list[bytes] = []
        self.images = 0
        self.sockets: list[str] = []
        page.route("**/*", self._pass_on)
        page.on("websocket", lambda socket: self.sockets.append(socket.url))
        page.on("console", lambda message: self.parts.append(message.text.encode()))

    def _pass_on(self, route: Route) -> None:
        request, response = route.request, route.fetch()
        self.images += response.headers.get("content-type") == "image/jpeg"
        self.parts.append(f"{request.method} {request.url} {request.post_data} {request.headers}".encode())
        self.parts += [json.dumps(response.headers_array).encode(), response.body()]
        route.fulfill(response=response)

    def telltale(self) -> list[str]:
        """Telltale texts in what was received, in any case, UTF-8 or UTF-16."""
        everything = b"\n".join(self.parts).lower()
        return [
            text
            for text in TELLTALE
            if text.lower().encode() in everything or text.lower().encode("utf-16-le") in everything
        ]


def second_success(place: int) -> bool:
    """The rater's verdict of the episode that is shown at a place."""
    return place % 4 != 0


def test_a_rater_judges_a_sample_without_a_trace_of_verdict_or_model(tmp_path: Path) -> None:
    results = tmp_path / "results"
    make_record(results)
    with served(results, sample=SAMPLE) as address, chromium() as browser:
        page = browser.new_page(viewport={"width": PHONE[0], "height": PHONE[1]})
        page.set_default_timeout(30_000)
        received = Received(page)
        page.goto(address)
        for place in range(SAMPLE):
            page.get_by_role("heading", name="Episode ").wait_for()
            page.get_by_text(f": {place} of {SAMPLE} episodes").wait_for()
            page.locator(".strip img").last.scroll_into_view_if_needed()
            if place == 0:
                loaded = "[...document.querySelectorAll('.strip img')].every((image) => image.naturalWidth === 64)"
                wait_until(lambda: page.evaluate(loaded), "the images are loaded")  # noqa: B023 - called at once
                assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
                assert accessibility_findings(page) == []
            page.click("[data-touched=no]")
            page.fill("[data-name=distance]", "0.7" if second_success(place) else "3.5")
            page.get_by_role("button", name="Confirm").click()
        page.get_by_text("All episodes are answered").wait_for()
        page.get_by_text("Your answers").click()
        page.locator("[data-retract]").first.click()
        page.get_by_text(f"{SAMPLE - 1} of {SAMPLE} episodes").wait_for()
        page.click("[data-touched=no]")
        page.fill("[data-name=distance]", "3.5")
        page.get_by_role("button", name="Confirm").click()
        page.get_by_text("All episodes are answered").wait_for()
        received.parts.append(page.content().encode())
        received.parts.append(json.dumps(page.evaluate("({...sessionStorage, ...localStorage})")).encode())
        received.parts.append(json.dumps(page.context.cookies()).encode())
    assert received.images >= 3 * SAMPLE
    assert received.sockets == []
    assert received.telltale() == []

    with open_record(sqlite_url(results / "vsnbench.db")) as engine, engine.connect() as connection:
        given = {judgement.episode: judgement.outcome == "success" for judgement in second_judgements(connection)}
    assert len(given) == SAMPLE
    first, second = [first_success(number) for number in given], list(given.values())
    report = json.loads(vsnbench(results, "report", "--format", "json").stdout)
    (rater,) = report["second_judgements"]
    assert (rater["rater"], rater["episodes"]) == ("Grace", SAMPLE)
    table = np.zeros((2, 2))
    np.add.at(table, (np.array(first, int), np.array(second, int)), 1)
    assert rater["kappa"] == pytest.approx(cohens_kappa(table).kappa)
    assert rater["same"] == pytest.approx(np.mean(np.equal(first, second)))
    assert rater["ci_low"] < rater["kappa"] < rater["ci_high"]
    different = [number for number, same in zip(given, np.equal(first, second), strict=True) if not same]
    assert [episode["episode"] for episode in rater["differing"]] == different
