"""Second judgements in the record: the latest counts, retraction, merging, permitted raters."""

import shutil
from pathlib import Path

import pytest

from tests.cli.test_record_verbs import vsnbench
from tests.results.records_of_a_lab import begun, plan, run, stopped
from vsnbench.errors import UsageError
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.schema.engine import reading, transaction
from vsnbench.results.second_judgements import Outcome, first_judges, second_judgements
from vsnbench.results.writing.journal import Journal


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Episode 1 is judged by Ana, 2 by the protocol, and 3 is running."""
    folder = tmp_path / "results"
    folder.mkdir()
    with Journal.open(sqlite_url(folder / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(plan()).trials
        for trial in trials[:2]:
            run(journal, trial, stopped(success=True))
        verdict = stopped(success=False).verdict
        assert verdict is not None
        journal.judge(1, verdict, author="Ana")
    return folder


def given(directory: Path) -> list[tuple[int, str, Outcome]]:
    with (
        Journal.open(sqlite_url(directory / "vsnbench.db")) as journal,
        transaction(reading(journal.engine)) as connection,
    ):
        found = second_judgements(connection)
    return [(judgement.episode, judgement.rater, judgement.outcome) for judgement in found]


def test_the_latest_answer_of_each_rater_counts_unless_it_is_retracted(directory: Path) -> None:
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        journal.judge_second(1, "Grace", Outcome.FAILURE, "far")
        journal.judge_second(1, "grace ", Outcome.SUCCESS, "near")
        journal.judge_second(2, "Grace", Outcome.VOID, "dark")
        journal.judge_second(2, "Joan", Outcome.SUCCESS, "near")
        journal.retract_second(2, "GRACE")
    assert given(directory) == [(1, "grace ", Outcome.SUCCESS), (2, "Joan", Outcome.SUCCESS)]


def test_merging_unites_answers_and_retractions(directory: Path, tmp_path: Path) -> None:
    other = shutil.copytree(directory, tmp_path / "other")
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        journal.judge_second(2, "Grace", Outcome.SUCCESS, "near")
    with Journal.open(sqlite_url(other / "vsnbench.db")) as journal:
        journal.judge_second(1, "Joan", Outcome.FAILURE, "far")
        journal.judge_second(2, "Joan", Outcome.FAILURE, "far")
        journal.retract_second(1, "Joan")
    done = vsnbench(directory, "db", "merge", str(other))
    assert done.returncode == 0, done.stderr
    assert given(directory) == [(2, "Grace", Outcome.SUCCESS), (2, "Joan", Outcome.FAILURE)]


def test_who_may_not_answer(directory: Path) -> None:
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[2]
        running = begun(journal, trial)
        for number, rater, code in (
            (1, "ANA", "first-judge"),
            (99, "Grace", "unknown-episode"),
            (running.id, "Grace", "no-first-judgement"),
        ):
            with pytest.raises(UsageError) as refused:
                journal.judge_second(number, rater, Outcome.SUCCESS, "")
            assert refused.value.code == code
        journal.end_episode(running.id, stopped(success=True))


def test_the_operator_of_a_session_is_one_of_the_first_judges(directory: Path) -> None:
    with Journal.open(sqlite_url(directory / "vsnbench.db")) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[3]
        claim = journal.claim_next(trial.campaign_id, [trial.id])
        assert claim is not None
        journal.set_operator(claim.id, "Ben")
        with transaction(reading(journal.engine)) as connection:
            assert first_judges(connection, [1, 2, claim.id]) == {1: {"Ana"}, claim.id: {"Ben"}}
