"""A record of two models on the same trials, and its page, in this process."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tests.results.records_of_a_lab import plan, run, stopped, void
from tests.shared_records import write_copy
from tests.web.browser import Browser
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.writing.journal import Journal
from vsnbench.web.results_browser.app import BrowserApp
from vsnbench.web_server.server import WebServer
from vsnbench.web_server.session_key import SessionKey

HOSTILE = "</script><img src=x onerror='window.pwned=1'>\x1b[31m\u202e"


def make_record(directory: Path, names: tuple[str, str] = ("slow", "fast"), disturbances: Disturbances = NONE) -> None:
    """Write two models: the first fails on the chair from 1, both succeed from 2, and the first has a void attempt.

    The first sees with disturbances, if there are any.
    """
    write_copy(directory, _write_record, names, disturbances)


def _write_record(directory: Path, names: tuple[str, str], disturbances: Disturbances) -> None:
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        for place, name in enumerate(names):
            given = plan(seed=place)
            if place == 0:
                given = replace(given, conditions={**given.conditions, **disturbances.conditions})
            trials = journal.find_or_create_campaign(replace(given, model=replace(given.model, name=name))).trials
            claims = [
                run(journal, trials[0], stopped(success=place == 1)),
                run(journal, trials[1], stopped(success=True)),
            ]
            if place == 0:
                run(journal, trials[2], void())
            for claim in claims:
                folder = directory / claim.images_directory / "rgb"
                folder.mkdir(parents=True)
                for number in (1, 2, 3):
                    picture = np.full((48, 64, 3), 40 * number, np.uint8)
                    assert cv2.imwrite(str(folder / f"{number:04d}.jpg"), picture)


@contextmanager
def served(directory: Path) -> Iterator[str]:
    """Serve the page of a record. Yields its address."""
    results = ResultsDirectory.locate(directory, None)
    with open_record(results.database_url) as engine, closing(BrowserApp(results, engine)) as app:
        app.prepare()
        with WebServer(app.routes(), SessionKey.new()) as server:
            yield server.addresses[0]


def entered(address: str) -> Browser:
    """Return a client that has opened the page."""
    client = Browser(address).enter()
    client.csrf_token = client.ask("GET", "/data/session.json").json["csrf_token"]
    return client
