"""Sessions and measured placements: written, ended, merged into other records."""

from dataclasses import replace
from pathlib import Path

from sqlalchemy import select, update

from tests.results.records_of_a_lab import complete, forward, plan, stopped
from vsnbench.interop.merge import merge, merge_source
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, list_episodes
from vsnbench.results.schema.tables import ProcessRow, SessionRow
from vsnbench.results.writing.campaigns import Trial
from vsnbench.results.writing.entries import EpisodeBegin
from vsnbench.results.writing.episodes import Claim
from vsnbench.results.writing.journal import Journal
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import MeasuredPlacement, PlacementMethod, PlacementTolerance, PoseCovariance
from vsnbench.values.pose import Pose

MEASURED = MeasuredPlacement(
    start=1,
    mark=Pose(1.0, 1.0, 0.5),
    pose=Pose(1.03, 1.01, 0.52),
    covariance=PoseCovariance(1e-4, 0.0, 0.0, 2e-4, 0.0, 1e-5),
    tolerance=PlacementTolerance(),
    method=PlacementMethod.TURN,
    looks=13,
    moved=("chair_1",),
)


def set_operator(journal: Journal, trial: Trial, *operators: str) -> Claim:
    """Begin an episode that each operator has confirmed, in this order."""
    claim = journal.claim_next(trial.campaign_id, [trial.id])
    assert claim is not None
    for operator in operators:
        journal.set_operator(claim.id, operator)
    journal.place(claim.id, Fix(MEASURED.pose, PoseSource.MEASURED))
    journal.begin(claim.id, EpisodeBegin(measured=MEASURED))
    return claim


def test_an_episode_names_its_operators_session_which_ends_at_a_takeover(url: str) -> None:
    with Journal.open(url) as journal:
        first, second, third, _ = journal.find_or_create_campaign(plan()).trials
        for trial, operators in ((first, ["Anna"]), (second, ["Anna"]), (third, ["Anna", "Ben"])):
            complete(journal, set_operator(journal, trial, *operators), stopped(success=True))
        one, other, last = (episode_record(journal.engine, number).session for number in (1, 2, 3))
        assert one is not None
        assert last is not None
        assert one == other
        assert (one.operator, one.words, last.operator, last.ended_at) == ("Anna", "Ben took over", "Ben", None)
        journal.clear_operator()
        ended = episode_record(journal.engine, 3).session
        assert ended is not None
        assert ended.ended_at is not None
        assert ended.ended_at >= ended.began_at


def test_a_measured_placement_is_kept_with_who_accepted_it(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        claim = set_operator(journal, trial, "Anna")
        kept = episode_record(journal.engine, claim.id).measured
        assert kept is not None
        assert (kept.author, kept.method, kept.looks, kept.moved) == ("Anna", "turn", 13, ("chair_1",))
        assert kept.pose == Fix(MEASURED.pose, PoseSource.MEASURED)
        assert (kept.covariance, kept.offset) == (MEASURED.covariance, MEASURED.offset)
        assert kept.determined
        assert kept.within_tolerance == MEASURED.within_tolerance
        assert kept.words == MEASURED.headline


def test_an_episode_that_nobody_attends_names_no_session_and_has_no_measurement(sqlite: str) -> None:
    with Journal.open(sqlite) as journal:
        claim = journal.claim_next(1, [journal.find_or_create_campaign(plan()).trials[0].id])
        assert claim is not None
        journal.clear_operator()
        details = episode_record(journal.engine, claim.id)
        assert (details.session, details.measured) == (None, None)


def test_a_session_whose_process_has_died_ends_with_the_last_sign_of_life_in_it(url: str) -> None:
    with Journal.open(url) as journal:
        claim = set_operator(journal, journal.find_or_create_campaign(plan()).trials[0], "Anna")
        journal.append_step(claim.id, forward(1))
        with journal.engine.begin() as connection:  # as if this process had been killed, and its id reused
            connection.execute(update(ProcessRow).values(start_ticks=1))
    with Journal.open(url) as journal:
        details = episode_record(journal.engine, claim.id)
        assert details.session is not None
        assert (details.session.ended_at, details.session.words) == (details.ended_at, "its process died")


def test_a_merge_brings_sessions_and_placements_once_however_often_it_is_run(tmp_path: Path) -> None:
    for name in ("ours", "theirs"):
        results = ResultsDirectory.locate(tmp_path / name, None)
        results.prepare()
        with Journal.open(sqlite_url(results.path / "vsnbench.db")) as journal:
            trials = journal.find_or_create_campaign(replace(plan(), seed=len(name))).trials
            for trial in trials[:2]:
                complete(journal, set_operator(journal, trial, name), stopped(success=True))
    ours = ResultsDirectory.locate(tmp_path / "ours", None)
    for _ in range(2):
        merge(ours, [merge_source(str(tmp_path / "theirs"))], without_images=True)
    with Journal.open(ours.database_url) as journal:
        found = [episode_record(journal.engine, one.id) for one in list_episodes(journal.engine, EpisodeFilter())]
        assert sorted(one.session.operator for one in found if one.session) == ["ours", "ours", "theirs", "theirs"]
        assert [one.measured.author for one in found if one.measured] == ["ours", "ours", "theirs", "theirs"]
        with journal.engine.connect() as connection:
            assert sorted(connection.scalars(select(SessionRow.operator))) == ["ours", "theirs"]
