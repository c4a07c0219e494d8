"""The thread that classifies failures ends with the page."""

import threading
from pathlib import Path

import pytest

from tests.web.results_browser.served_record import make_record
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.migrate import open_record
from vsnbench.web.results_browser.failures import FailureKinds


def test_the_page_can_be_closed_while_the_thread_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_record(tmp_path)
    closed: list[threading.Thread] = []
    start = threading.Thread.start

    def close_and_start(thread: threading.Thread) -> None:
        if thread.name == "failure-kinds":
            closing = threading.Thread(target=kinds.close)
            start(closing)
            closing.join(0.2)
            closed.append(closing)
        start(thread)

    with open_record(sqlite_url(tmp_path / "vsnbench.db")) as engine:
        kinds = FailureKinds(engine)
        monkeypatch.setattr(threading.Thread, "start", close_and_start)
        kinds.update()
        closed[0].join(10.0)
        assert kinds.is_complete
        kinds.update()
        assert len(closed) == 1
