"""The example of a motion adapter drives the simulated apartment by the commands of its page."""

import os
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.cli.console import vsnbench_process
from tests.models.remote.servers import PATIENCE_S, await_port, free_port

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "motion_adapters"


@pytest.fixture
def profile(tmp_path: Path) -> Iterator[Path]:
    """The profile of the example, while its adapter runs."""
    port = free_port()
    words = [sys.executable, "socket_adapter.py", "apartment:Apartment"]
    with (tmp_path / "adapter.log").open("wb") as log:
        environment = {**os.environ, "ADAPTER_PORT": str(port)}
        adapter = subprocess.Popen(words, cwd=EXAMPLES, env=environment, stdout=log, stderr=log)
    try:
        await_port(port, adapter)
        path = tmp_path / "robot.yaml"
        text = (EXAMPLES / "simulated_base.yaml").read_text(encoding="utf-8")
        path.write_text(text.replace("8770", str(port)), encoding="utf-8")
        yield path
    finally:
        adapter.kill()
        adapter.wait(PATIENCE_S)


def output_of(*words: str | Path) -> str:
    with vsnbench_process([str(word) for word in words]) as process:
        out, err = process.communicate(timeout=600)
    assert process.returncode == 0, out + err
    return out


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_apartment_behind_an_adapter_passes_the_checks_and_records_a_trial(profile: Path, tmp_path: Path) -> None:
    results = tmp_path / "results"
    assert "lost client" in output_of("doctor", "--robot", profile, "--move", "--results", results)
    output_of("run", "--robot", profile, "--model", "oracle", "--goal", "chair", "--starts", "1", "--results", results)
    judged = """
        select success, verdict.end_reason, verdict.distance_source
        from verdict join episode on episode.id = episode_id where state = 'judged'
    """
    with closing(sqlite3.connect(results / "vsnbench.db")) as connection:
        assert connection.execute("select kind, simulated from robot").fetchall() == [("adapter", 1)]
        assert connection.execute(judged).fetchall() == [(1, "stop", "simulated")]
