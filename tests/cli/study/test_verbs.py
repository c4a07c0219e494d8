"""`vsnbench study` from the command line, in the embedded apartment with a real database."""

import json
import os
import re
import signal
import sqlite3
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tests.cli.console import Answer, vsnbench, vsnbench_process
from vsnbench.cli.study import running
from vsnbench.cli.study.file import open_study
from vsnbench.errors import RobotError
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.studies.entries import SESSION
from vsnbench.results.studies.queries import trials_of
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import gather_provenance
from vsnbench.runner.study.arms import StudyPlace
from vsnbench.study.lock import sha256_of

QUICK = '"""Policies that end at once."""\nimport logging\nfrom vsnbench.models.contract import ModelCard, Policy\n'
QUICK += "from vsnbench.values.movement import Action\nfrom vsnbench.values.decision import Decision, Diagnostics\n"
for _name, _turns in (("Heron", 1), ("Magpie", 3)):
    QUICK += f"""
class {_name}(Policy):
    card = ModelCard("{_name.lower()}", weights_label="{_name.lower()} weights", weights_sha256="{_name.lower()}0" * 6)
    def reset(self, goal, seed):
        self.asked = 0
        print("{_name.lower()} starts")
        logging.getLogger("aviary").warning("the third eye of {_name.lower()} is shut")
    def act(self, observation):
        self.asked += 1
        said = Diagnostics(note="i am {_name.lower()}", scalars={{"{_name.lower()}": 1.0}})
        action = Action.TURN_LEFT if self.asked <= {_turns} else Action.STOP
        return Decision(action, "{_name.upper()}_" + action.value, said)
"""
QUICK += """
class Wren(Heron):
    card = ModelCard("wren")
    def act(self, observation):
        raise ValueError("wren has lost her way")
"""
TELLING = re.compile(rb"heron|magpie|wren|third eye|traceback", re.IGNORECASE)


class Lab:
    """A directory with models and studies, and the command line."""

    def __init__(self, path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.path = path
        self._call = lambda *words: vsnbench(monkeypatch, capsys, *words)
        (path / "aviary.py").write_text(QUICK)
        monkeypatch.setenv("VSNBENCH_ROBOT", "simulated:turtlebot2@160x120")
        monkeypatch.chdir(path)
        monkeypatch.syspath_prepend(str(path))

    def __call__(self, *words: str) -> Answer:
        # These studies are small: without --force, `lock` refuses a design without power.
        return self._call("study", *words, *(["--force"] if words == ("lock",) else []))

    def other(self, *words: str) -> Answer:
        return self._call(*words)

    def new(self, *words: str, arms: tuple[str, ...] = ("Heron", "Magpie")) -> None:
        chosen = [word for name in arms for word in ("--arm", f"{name.lower()}=aviary:{name}")]
        answer = self("new", *chosen, "--goal", "bed,chair", "--starts", "1-2", "--seed", "5", *words)
        assert answer.code == 0, answer.err

    def outcomes(self) -> list[tuple[object, ...]]:
        study = open_study(Path("study.yaml"), None, None)
        with open_record(study.results.database_url) as engine:
            found = trials_of(engine, study.recorded.id)
        return [(one.arm, one.trial.goal, one.trial.start, one.success) for one in found]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lab:
    return Lab(tmp_path, monkeypatch, capsys)


def test_a_blind_study_from_new_to_report_names_no_model_anywhere_an_operator_looks(lab: Lab) -> None:
    lab.new(arms=("Heron", "Magpie", "Wren"))
    assert "heron" in lab("check").out
    assert lab("lock").code == 0
    seen = [lab("run"), lab("run")]
    assert "arm" in seen[0].err
    assert "was left out" in seen[0].err
    seen += [lab("status"), lab("report"), lab("report", "--format", "json"), lab("report", "--format", "html")]
    assert "<button" not in seen[-1].out, "tables cannot be sorted without scripts"
    seen += [lab("report", "--format", "markdown"), lab("report", "--format", "latex")]
    for words in (
        ("episodes", "list"),
        ("episodes", "list", "--json"),
        ("episodes", "show", "1"),
        ("episodes", "show", "1", "--steps"),
        ("episodes", "show", "1", "--json"),
        ("db", "status"),
        ("db", "status", "--json"),
        ("report", "--all-tables"),
        ("report", "--format", "json"),
        ("report", "--format", "csv"),
        ("report", "--output", "page"),
        ("export", "csv", "-o", "steps.csv"),
        ("judge", "--pending"),
    ):
        seen.append(lab.other(*words))
    assert {answer.code for answer in seen[2:]} == {0}
    for answer in seen:
        assert not TELLING.search(f"{answer.out}{answer.err}".encode()), answer
    files = [path for path in (*Path("results").rglob("*"), *Path("page").rglob("*")) if path.is_file()]
    assert len([path for path in files if path.name == "episode.rrd"]) >= 8
    told = [path for path in files if "vsnbench.db" not in path.name and TELLING.search(path.read_bytes())]
    assert told == []
    assert not [path for path in files if TELLING.search(str(path).encode())]
    arm, stranger = (lab.other("episodes", "list", "--model", name) for name in ("heron", "stranger"))
    assert (arm.code, arm.err) == (2, stranger.err.replace("stranger", "heron")), (
        "the error is the same for an arm and for a typo"
    )
    merged = lab.other("db", "merge", "results", "--results", "merged")
    assert ", 1 new study" in merged.out
    elsewhere = [lab(verb, "--results", "merged") for verb in ("status", "report")]
    elsewhere += [lab.other(*words, "--results", "merged") for words in (("episodes", "list"), ("report",))]
    for answer in (merged, *elsewhere):
        assert answer.code == 0
        assert not TELLING.search(f"{answer.out}{answer.err}".encode()), answer
    unblinded = lab("unblind", "--reason", "we want to see the page")
    assert "is heron" in unblinded.out
    assert "early" in unblinded.err
    assert "heron" in lab.other("episodes", "list").out
    report = lab("report").out
    assert "unblinded early" in report
    assert "we want to see the page" in " ".join(report.split()), "at every width"


def test_a_killed_study_keeps_its_schedule_and_has_the_outcomes_of_plain_runs(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.new()
    assert lab("lock").code == 0
    before = [one[:3] for one in lab.outcomes()]

    def judged() -> int:
        with sqlite3.connect("results/vsnbench.db") as database:
            return int(database.execute("SELECT COUNT(*) FROM episode WHERE state = 'judged'").fetchone()[0])

    monkeypatch.setenv("PYTHONPATH", str(lab.path), prepend=os.pathsep)
    for done in (1, 3):
        with vsnbench_process(["study", "run"]) as process:
            deadline = time.monotonic() + 120
            while judged() < done:
                assert process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.02)
            process.send_signal(signal.SIGKILL)
            process.wait()
    assert lab("run").code == 0
    assert [one[:3] for one in lab.outcomes()] == before
    with sqlite3.connect("results/vsnbench.db") as database:
        assert database.execute(
            "SELECT MAX(n) FROM (SELECT COUNT(*) n FROM episode WHERE state = 'judged' GROUP BY trial_id)"
        ).fetchone() == (1,)
        seeds = database.execute("SELECT DISTINCT trial_id, seed FROM episode").fetchall()
    assert len(seeds) == 8
    for name in ("Heron", "Magpie"):
        words = ("--goal", "bed,chair", "--starts", "1-2", "--seed", "5", "--results", "plain")
        assert lab.other("run", "--model", f"aviary:{name}", *words).code == 0
    listed = json.loads(lab.other("episodes", "list", "--results", "plain", "--json").out)
    plain = {(one["model"], one["goal"], one["start"]): one["success"] for one in listed}
    assert {one[:3]: one[3] for one in lab.outcomes()} == plain
    assert "ended abnormally" in lab("report").out


def test_a_changed_byte_and_an_amendment_are_reported_by_run_report_and_status(lab: Lab) -> None:
    lab.new()
    assert lab("lock").code == 0
    file = Path("study.yaml")
    locked = file.read_text()
    file.write_text(locked.replace("alpha: 0.05", "alpha: 0.06"))
    arm, stranger = (
        lab.other("run", "--model", f"aviary:{name}", "--goal", "bed", "--seed", "5") for name in ("Heron", "Wren")
    )
    assert arm == stranger, "a refusal does not reveal which models are arms"
    assert "seed 5 is that of the blinded study 'Which of 2 models finds its goal?'" in arm.err
    words = "study.yaml was changed after it was locked: line"
    refused = lab("run")
    assert (refused.code, refused.out) == (2, "")
    for answer in (refused, lab("status"), lab("report")):
        assert words in answer.err
        assert "`alpha: 0.06`, and was `alpha: 0.05`" in answer.err
    file.write_text(locked.replace("aviary:Magpie", "aviary:Wren"))
    told = lab("status").err
    assert "which names a model and is hidden while the study is blinded" in told
    assert not TELLING.search(told.encode())
    file.write_text(locked.replace("alpha: 0.05", "alpha: 0.06"))
    assert "no reason given" in lab("amend").err
    assert lab("amend", "--reason", "a typing error").code == 0
    assert lab("status").err == ""
    assert "a typing error" in lab("report").out
    file.write_text(locked.replace("seed: 5", "seed: 6"))
    assert "seed: fields that determine the schedule cannot be amended" in lab("amend", "--reason", "x").err


def test_a_robot_in_another_session_of_the_study_is_refused_with_its_operator(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.new()
    assert lab("lock").code == 0

    def taken(self: StudyPlace) -> None:
        raise RobotError("/vsnbench is already running on this robot", advice="end it first")

    monkeypatch.setattr(StudyPlace, "robot", taken)
    assert "already running on this robot" in lab("run").err, (
        "no other process runs the study, so the robot's error is shown"
    )
    study = open_study(Path("study.yaml"), None, None)
    with Journal.open(study.results.database_url, replace(gather_provenance(), operator="Ada")) as journal:
        journal.note_in_study(study.recorded.id, SESSION, "Ada")
        refused = lab("run")
    assert refused.code == 2
    assert f"this study is being run by Ada (process {os.getpid()} on" in refused.err
    assert "one robot runs one trial at a time" in refused.err
    assert len(refused.err.strip().splitlines()) == 1


def test_what_cannot_be_locked_is_one_line_and_nothing_is_written(lab: Lab) -> None:
    lab.new()
    good = Path("study.yaml").read_text()
    cases = {
        "vlv does not know monitor": good.replace("aviary:Heron", "vlv").replace("bed, chair", "monitor"),
        "starting position 40 is not in site": good.replace('"1-2"', '"1-40"'),
        "no model 'aviary'": good.replace("aviary:Heron", "aviary"),
        "2 starting positions are too few": good.replace(
            "stopping: plan", "about: cells-like-these\nstopping: decided"
        ),
        "compares at least two models": good.replace('  magpie:\n    model: "aviary:Magpie"\n', ""),
        "heron and magpie are the same model with the same settings": good.replace("aviary:Magpie", "aviary:Heron"),
    }
    for words, text in cases.items():
        Path("study.yaml").write_text(text)
        answer = lab("lock")
        assert (answer.code, answer.out) == (2, ""), words
        assert words in answer.err.splitlines()[-1], answer.err
        assert answer.err.count("error:") == 1, answer.err
        assert not Path("results").exists()
        assert not Path("study.yaml.lock").exists()
    Path("study.yaml").write_text(good)
    assert "is not locked in" in lab("run").err
    assert lab("lock").code == 0
    assert "already locked" in lab("lock").err
    assert "is locked in another record, results/vsnbench.db" in lab("run", "--results", "elsewhere").err
    assert "no reason given" in lab("unblind").err
    assert not Path("elsewhere").exists()


def test_a_record_that_was_changed_is_named_by_every_verb_and_not_run(lab: Lab) -> None:
    lab.new()
    assert lab("lock").code == 0
    assert lab("run", "--only-next").code == 1
    with sqlite3.connect("results/vsnbench.db") as database:
        database.execute("UPDATE verdict SET success = 1 - success")
    refused = lab("run")
    assert (refused.code, refused.out) == (2, "")
    for answer in (refused, lab("status"), lab("report"), lab("amend", "--reason", "x")):
        assert re.search(r"verdict 1 of episode #1 \(arm . on .*\) was a failure and is a success", answer.err)
        assert not TELLING.search(answer.err.encode())
    assert len(json.loads(lab("status", "--json").out)["differences"]) == 1
    report = json.loads(lab("report", "--format", "json").out)
    assert [one["what"] for one in report["deviations"]] == ["record changed"]
    assert "the conclusion is unreliable" in report["conclusion"]
    assert len(lab.outcomes()) == 8


@pytest.mark.parametrize("with_its_hash", [False, True])
def test_a_plan_that_was_changed_in_the_record_is_named_by_its_line(lab: Lab, with_its_hash: bool) -> None:
    lab.new()
    assert lab("lock").code == 0
    text = Path("study.yaml").read_text().replace("alpha: 0.05", "alpha: 0.2")
    with sqlite3.connect("results/vsnbench.db") as database:
        database.execute("UPDATE study SET content = ?", (text,))
        if with_its_hash:
            database.execute("UPDATE study SET sha256 = ?", (sha256_of(text),))
    for answer in (lab("run"), lab("status"), lab("report"), lab("amend", "--reason", "x")):
        assert "`alpha: 0.2`, and was `alpha: 0.05`" in answer.err
        assert "restore a backup" in answer.err or answer.code == 0


@pytest.mark.parametrize("fault", ["missing", "of another study", "of another record", "of an older version"])
def test_a_lock_file_that_does_not_fit_is_one_line_and_can_be_written_again(lab: Lab, fault: str) -> None:
    lab.new()
    assert lab("lock").code == 0
    lock_file = Path("study.yaml.lock")
    locked = json.loads(lock_file.read_text())
    if fault == "missing":
        lock_file.unlink()
    elif fault == "of another study":
        Path("study.yaml").rename("first.yaml")
        lock_file.rename("first.yaml.lock")
        lab.new("--title", "Another", arms=("Magpie", "Wren"))
        assert lab("lock", "--results", "results").code == 2, "the seed is in use"
        Path("study.yaml").write_text(Path("study.yaml").read_text().replace("seed: 5", "seed: 6"))
        assert lab("lock").code == 0
        lock_file.write_bytes(Path("first.yaml.lock").read_bytes())
    elif fault == "of another record":
        changed = ("study", "sha256", "event_sha256")
        other = {name: ("2" if locked[name][0] == "1" else "1") + locked[name][1:] for name in changed}
        lock_file.write_text(json.dumps(locked | other))
    else:
        lock_file.write_text(json.dumps({name: locked[name] for name in ("study", "sha256", "locked_at", "database")}))
    if fault == "of an older version":
        assert lab("status").err == ""
        assert lab("run", "--only-next").code == 1
        return
    before = Path("results/vsnbench.db").read_bytes()
    refused = lab("run")
    assert (refused.code, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "study.yaml.lock" in refused.err
    assert "restore a backup" not in refused.err, "the record is intact"
    assert Path("results/vsnbench.db").read_bytes() == before
    lock_file.unlink(missing_ok=True)
    assert lab("lock").code == 0
    assert lab("status").err == ""
    if fault == "missing":
        assert json.loads(lock_file.read_text()) == locked


def test_a_design_that_can_show_nothing_is_locked_only_by_force(lab: Lab) -> None:
    lab.new()
    refused = lab.other("study", "lock")
    assert (refused.code, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "requires at least 6 starting positions" in refused.err
    assert not Path("results").exists()
    assert lab.other("study", "lock", "--force").code == 0


def test_a_planned_twin_is_run_by_the_study_before_the_first_real_trial(lab: Lab) -> None:
    lab.new("--twin", "6", "--starts", "3-5")
    assert lab("lock").code == 0
    refused = lab("run")
    assert refused.code == 2
    assert "lacks simulated trials in 10 of 10 cells" in refused.err
    assert "vsnbench study run --twin study.yaml" in refused.err
    assert lab("run", "--twin", "--only-next").code == 2
    twin = lab("run", "--twin")
    assert (twin.code, lab("run", "--twin").code) == (0, 0)
    assert "next: vsnbench study run study.yaml" in twin.err
    assert lab("run").code == 0
    assert len(lab.outcomes()) == 12, "6 random cells, two arms"
    method = json.loads(lab("report", "--json").out)["primary"]["method"]
    assert "prediction-powered by the planned twin" in method


def test_a_twin_after_the_first_real_trial_is_refused_in_one_line(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    lab.new("--twin", "6", "--starts", "3-5")
    assert lab("lock").code == 0
    with monkeypatch.context() as earlier_version:
        earlier_version.setattr(running, "twin_gap", lambda *_: "")
        begun = lab("run", "--only-next")
    assert [success for *_, success in lab.outcomes() if success is not None], begun.err
    for words in (("run",), ("run", "--twin")):
        refused = lab(*words)
        assert (refused.code, len(refused.err.strip().splitlines())) == (2, 1)
        assert "real trials have begun: a twin that is run after the first of them does not count" in refused.err


def test_a_study_without_a_twin_has_none_to_run(lab: Lab) -> None:
    lab.new()
    assert lab("lock").code == 0
    refused = lab("run", "--twin")
    assert (refused.code, len(refused.err.strip().splitlines())) == (2, 1)
    assert "plans no twin" in refused.err
