"""The results browser as a process."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.web.browser import Browser
from tests.web.results_browser.served_record import make_record


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_the_page_and_removes_its_videos(tmp_path: Path, number: signal.Signals) -> None:
    make_record(tmp_path / "results")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    words = [sys.executable, "-m", "vsnbench.cli.main", "browse", "--port", "0", "--results", str(tmp_path / "results")]
    environment = os.environ | {"TMPDIR": str(temporary)}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        answer = Browser(address).enter().ask("GET", "/video/1.mp4")
        assert answer.status == 200
        assert list(temporary.rglob("*.mp4"))
        process.send_signal(number)
        assert process.wait(30) == 0
    assert not [path for path in temporary.rglob("*") if "videos" in path.name]
