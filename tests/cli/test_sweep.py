import json
import sqlite3
from contextlib import closing
from pathlib import Path

from tests.cli.test_record_verbs import vsnbench
from vsnbench.cli.running.sweep_summary import cost_line
from vsnbench.runner.setup.sweep import Cost

CAMERA = ("--robot", "simulated:turtlebot2@64x48")
SWEEP = ("run", "--model", "forward,random", "--seed", "0-1", "--goal", "chair", "--max-steps", "2", "--workers", "1")
SWEEP += CAMERA


def test_a_sweep_is_run_reported_and_gone_on_with_like_any_run(tmp_path: Path) -> None:
    first = vsnbench(tmp_path, *SWEEP, "--starts", "1")
    assert first.returncode == 0, first.stderr
    assert "4 campaigns, up to 4 trials: about 24 s on 1 worker, at 3 s a trial, a guess" in first.stderr
    assert "all 4 trials are done" in first.stderr
    more = vsnbench(tmp_path, *SWEEP, "--starts", "1-2")
    assert "up to 8 trials, 4 of them done" in more.stderr
    assert "from 4 timed episodes" in more.stderr
    assert "4/4 seed 1: random in apartment" in more.stderr
    models = json.loads(vsnbench(tmp_path, "report", "--format", "json").stdout)["models"]
    assert [(model["model"], model["seeds"]) for model in models] == [("forward", [0, 1]), ("random", [0, 1])]


def test_the_workers_of_a_sweep_stay_from_campaign_to_campaign(tmp_path: Path) -> None:
    words = ("--model", "forward,random", "--goal", "chair", "--starts", "1-2", "--max-steps", "2", "--workers", "2")
    done = vsnbench(tmp_path, "run", *words)
    assert done.returncode == 0, done.stderr
    query = """
        SELECT c.id, p.pid FROM episode e JOIN process p ON p.id = e.process_id
        JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id WHERE e.state = 'judged'
    """
    with closing(sqlite3.connect(tmp_path / "vsnbench.db")) as connection:
        ran = connection.execute(query).fetchall()
        processes = {pid for (pid,) in connection.execute("SELECT pid FROM process")}
    assert sorted(campaign for campaign, _ in ran) == [1, 1, 2, 2]
    assert len({pid for _, pid in ran}) <= 2
    assert len(processes) <= 3, "the driver and two workers"


def test_a_sweep_that_is_done_says_so() -> None:
    assert cost_line(Cost(1, 20, 20, 0.0, 2, 7)) == "1 campaign, up to 20 trials, 20 of them done"
