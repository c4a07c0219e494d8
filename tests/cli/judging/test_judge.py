import json
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cli.running.test_run_with_a_person import Seat
from tests.cli.test_record_verbs import vsnbench
from tests.results.records_of_a_lab import begun, plan, run, stopped, void
from vsnbench.report.table import goal_distance
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A proposed success (1), a void attempt (2), a judged success (3), and a running episode (4)."""
    with Journal.open(sqlite_url(tmp_path / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(plan()).trials
        run(journal, trials[0], replace(stopped(success=True), proposed=True))
        run(journal, trials[1], void())
        run(journal, trials[2], stopped(success=True))
        begun(journal, trials[3])
    return tmp_path


def shown(results: Path, number: int) -> dict[str, object]:
    told: dict[str, object] = json.loads(vsnbench(results, "episodes", "show", str(number), "--json").stdout)
    return told


def test_what_awaits_a_word_is_listed_with_its_proposal(results: Path) -> None:
    assert "judged" in vsnbench(results, "judge", "--pending").stdout
    (waiting,) = json.loads(vsnbench(results, "judge", "--pending", "--json").stdout)
    assert (waiting["id"], waiting["goal"], waiting["proposed_success"]) == (1, "chair", True)
    vsnbench(results, "judge", "1", "--confirm")
    assert "no episode awaits" in vsnbench(results, "judge", "--pending").stderr


def test_a_proposal_counts_when_it_is_confirmed_and_keeps_its_author(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VSNBENCH_OPERATOR", "ada")
    assert shown(results, 1)["success"] is None
    done = vsnbench(results, "judge", "1", "--confirm", "--note", "seen from the door")
    assert (done.returncode, done.stdout) == (0, "episode 1 judged by ada: judged\n"), done.stderr
    told = shown(results, 1)
    assert (told["success"], told["distance_m"], told["distance_source"]) == (True, 0.4, "simulated")
    proposal, word = told["verdicts"]
    assert (proposal["proposed"], proposal["author"]) == (True, "vsnbench")
    assert (word["proposed"], word["author"], word["source"], word["note"]) == (
        False, "ada", "person", "seen from the door",
    )  # fmt: skip


def test_a_tape_a_collision_and_a_void_amend_what_stood_and_nothing_is_forgotten(results: Path) -> None:
    measured = vsnbench(results, "judge", "3", "--distance", "1.2", "--yes")
    assert "1.200 m from chair_1 (tape), not under 1 m" in measured.stdout
    assert shown(results, 3)["success"] is False
    assert "the cat (seen by a person)" in vsnbench(results, "judge", "3", "--collision", "the cat", "--yes").stdout
    assert shown(results, 3)["collision"] is True
    vsnbench(results, "judge", "3", "--void", "a visitor stood in the way", "--yes")
    told = shown(results, 3)
    assert (told["outcome"], len(told["verdicts"])) == ("void", 4)
    vsnbench(results, "judge", "3", "--distance", "40 cm", "--yes")
    assert shown(results, 3)["success"] is True


def test_no_distance_makes_a_result_of_what_ended_without_a_stop(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.mkdir()
    (log / "datos.csv").write_text("1,chair,['Forward'],1\n", encoding="utf-8")
    imported = vsnbench(tmp_path, "import", "ros4vsn", str(log), "--model", "vlv")
    assert imported.returncode == 0, imported.stderr
    listed = vsnbench(tmp_path, "judge", "--pending")
    assert "--void REASON" in listed.stderr
    assert "--distance" not in listed.stderr
    done = vsnbench(tmp_path, "judge", "1", "--distance", "0.4")
    assert (done.returncode, done.stdout) == (2, "")
    assert "episode 1 ended with aborted, without a STOP" in done.stderr
    assert json.loads(vsnbench(tmp_path, "judge", "--pending", "--json").stdout)[0]["id"] == 1


@pytest.mark.parametrize(("reply", "verdicts"), [("n", 1), ("y", 2)])
def test_a_change_of_a_standing_verdict_is_asked_back_on_a_terminal(results: Path, reply: str, verdicts: int) -> None:
    seat = Seat(results, "judge", "3", "--distance", "2.4")
    seat.wait_for("changes success to failure; episode 3 is already judged")
    seat.wait_for("Confirm?")
    seat.type(f"{reply}\n")
    seat.wait_for("nothing was written" if reply == "n" else "episode 3 judged by maria")
    assert seat.process.wait(60) == (1 if reply == "n" else 0)
    seat.hang_up()
    assert len(shown(results, 3)["verdicts"]) == verdicts


def test_a_failure_just_beyond_the_success_distance_is_not_listed_as_at_it(results: Path) -> None:
    done = vsnbench(results, "judge", "3", "--distance", "1.001", "--yes")
    assert "1.001 m from chair_1" in done.stdout
    assert " 1.001 m" in vsnbench(results, "episodes", "list").stdout
    assert "1.001 m (tape)" in vsnbench(results, "episodes", "show", "3").stdout
    assert goal_distance(1.001, 1.0).text == "1.001", "in tables and on the page of a report"
    vsnbench(results, "judge", "3", "--distance", "0.9996", "--yes")
    assert "0.9996 m from chair_1 (tape), under 1 m" in vsnbench(results, "episodes", "show", "3").stdout
