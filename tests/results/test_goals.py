"""Goal definitions in the record survive a run, a report and a merge."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
import shapely
from sqlalchemy import select

from tests.evidence.verification.conftest import lines, verified
from tests.sites.goal_sites import GOALS, write_site
from vsnbench.errors import RecordError, UsageError
from vsnbench.interop.merge import merge, merge_source
from vsnbench.protocol.judge import success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.courses import measures_of
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.goals import definitions
from vsnbench.results.reading.queries import episode_record, episode_steps
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.schema.tables import GoalRow, TrialRow
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.launch import launch
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import Site, load_site
from vsnbench.values.goal import GoalKind


def run(site: Path, goals: str, results: Path, seed: int = 0, model: str = "oracle") -> ResultsDirectory:
    directory = ResultsDirectory.locate(results)
    setup = TrialSetupSpec(load_site(site), model, (goals,), keep=KeepFiles.NONE)
    request = RunRequest(setup, directory, starts=(1,), seed=seed, workers=WorkerOptions(1))
    launch(request.at(str(site), setup.site), OperatorProvider(unattended=True))
    return directory


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return write_site(tmp_path)


def test_the_oracle_reaches_every_kind_of_goal_and_the_record_keeps_its_definition(site: Path, tmp_path: Path) -> None:
    names = "red-armchair,window-corner,photo-bed,cold-box,to-the-kitchen,chair"
    results = run(site, names, tmp_path / "r")
    with open_record(results.database_url) as engine:
        with engine.connect() as connection:
            goals = definitions(connection)
            assert goals["photo-bed"].kind is GoalKind.IMAGE
            photograph = connection.scalar(select(GoalRow.image).where(GoalRow.name == "photo-bed"))
            assert photograph == (tmp_path / "bed.png").read_bytes()
            assert connection.execute(select(TrialRow.goal).where(TrialRow.goal_id.is_(None))).scalars().all() == [
                "chair"
            ]
        recorded = Site.model_validate(episode_record(engine, 1).provenance.site_content)
    assert recorded.sha256 == load_site("apartment").sha256
    assert {goal.id: goal.sha256 for goal in recorded.goals} == {goal.id: goal.sha256 for goal in load_site(site).goals}
    report = read(results.database_url, Selection())
    assert report.counted()["success"].tolist() == [True] * 6
    assert report.goals["to-the-kitchen"].kind is GoalKind.INSTRUCTION
    (summary,) = summarise(report).conditions
    totals = {total.kind: (total.successes, total.planned) for total in summary.kinds}
    assert totals == {
        GoalKind.CATEGORY: (2, 2),
        GoalKind.TEXT: (2, 2),
        GoalKind.IMAGE: (1, 1),
        GoalKind.INSTRUCTION: (1, 1),
    }


def test_a_report_of_categories_has_no_totals_by_kind(site: Path, tmp_path: Path) -> None:
    results = run(site, "chair,bed", tmp_path / "r", model="random")
    (summary,) = summarise(read(results.database_url, Selection())).conditions
    assert summary.kinds == ()


def test_a_changed_goal_is_refused_in_its_campaign_and_not_pooled_with_others(site: Path, tmp_path: Path) -> None:
    results = run(site, "red-armchair", tmp_path / "r")
    write_site(tmp_path, GOALS.replace("the red armchair", "the old armchair"))
    with pytest.raises(UsageError) as refused:
        run(site, "red-armchair", tmp_path / "r")
    assert refused.value.code == "goal-changed"
    run(site, "red-armchair", tmp_path / "r", seed=1)
    report = read(results.database_url, Selection())
    names = set(report.counted()["goal"])
    assert len(names) == 2
    assert names == {goal for _, goal, _ in report.planned}
    assert names <= set(report.goals)
    assert all(name.startswith("red-armchair@") for name in names)


def test_a_merge_keeps_definitions_and_refuses_different_ones(site: Path, tmp_path: Path) -> None:
    first, mine = run(site, "photo-bed", tmp_path / "a"), tmp_path / "mine"
    merge(ResultsDirectory.locate(mine), [merge_source(str(tmp_path / "a"))])
    with open_record(ResultsDirectory.locate(mine).database_url) as engine, engine.connect() as connection:
        image = connection.execute(select(GoalRow.image).join(TrialRow, TrialRow.goal_id == GoalRow.id)).scalar_one()
    assert image == (tmp_path / "bed.png").read_bytes()
    assert first.database_url
    write_site(tmp_path, GOALS.replace("targets: [bed-1]", "targets: [{category: bed}]"))
    run(site, "photo-bed", tmp_path / "b")
    with pytest.raises(RecordError) as refused:
        merge(ResultsDirectory.locate(mine), [merge_source(str(tmp_path / "b"))])
    assert refused.value.code == "goal-changed"


def test_a_model_of_categories_is_not_given_a_sentence_and_nothing_is_written(site: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        run(site, "red-armchair", tmp_path / "r", model="vlv")
    assert refused.value.code == "goal-kind"
    assert not (tmp_path / "r").exists()


def test_a_sequence_is_recorded_reported_merged_and_verified_leg_by_leg(tmp_path: Path) -> None:
    site = write_site(
        tmp_path, GOALS + "  - {id: tour, kind: sequence, goals: [chair, window-corner, to-the-kitchen]}\n"
    )
    results = run(site, "tour", tmp_path / "r")
    mine = ResultsDirectory.locate(tmp_path / "mine")
    merge(mine, [merge_source(str(tmp_path / "r"))])
    for directory in (results, mine):
        with open_record(directory.database_url) as engine:
            episode = episode_record(engine, 1)
        assert episode.outcome == "success"
        assert [(leg.position, leg.goal, leg.success) for leg in episode.legs] == [
            (1, "chair", True),
            (2, "window-corner", True),
            (3, "to-the-kitchen", True),
        ]
        assert sum(leg.actions for leg in episode.legs) == episode.actions
        assert all(leg.shortest_m is not None and 0 < leg.shortest_m <= leg.path_m for leg in episode.legs)
        rows = read(directory.database_url, Selection()).legs
        assert [(row["position"], row["rate"].successes, row["rate"].trials) for row in rows] == [
            *((number, 1, 1) for number in (1, 2, 3)),
            (None, 1, 1),
        ]
        assert rows[3]["spl"] == pytest.approx(
            sum(leg.shortest_m or 0 for leg in episode.legs) / sum(leg.path_m for leg in episode.legs)
        )
    assert lines(verified(tmp_path / "r", replay=1)) == []
    for column, value in (("success", "false"), ("actions", "1"), ("path_m", "0.5"), ("end_reason", '"collision"')):
        changed = shutil.copytree(tmp_path / "r", tmp_path / column)
        with closing(sqlite3.connect(changed / "vsnbench.db")) as database, database:
            database.execute(f"UPDATE episode SET legs = json_set(legs, '$[1].{column}', json('{value}'))")
        assert [line for line in lines(verified(changed)) if f"{column} of goal 2" in line]


def test_sequences_have_oracle_success_and_the_share_of_goals_reached(tmp_path: Path) -> None:
    site = write_site(tmp_path, GOALS + "  - {id: tour, kind: sequence, goals: [chair, window-corner, bed]}\n")
    missed = run(site, "tour", tmp_path / "missed")
    with closing(sqlite3.connect(tmp_path / "missed" / "vsnbench.db")) as database, database:
        database.execute("UPDATE episode SET legs = json_set(legs, '$[1].success', json('false'))")
        database.execute("UPDATE verdict SET success = 0")
    rows = read(missed.database_url, Selection()).legs
    shown = [(row["rate"].successes, row["mean_oracle_success"], row["progress"]) for row in rows]
    assert shown == [(1, 1.0, None), (0, 1.0, None), (1, 1.0, None), (0, 1.0, pytest.approx(2 / 3))]
    wandered = run(site, "tour", tmp_path / "wandered", model="random")
    with open_record(wandered.database_url) as engine:
        episode, steps = episode_record(engine, 1), episode_steps(engine, 1)
        measured = measures_of(engine, episode)
    (start,) = [start.pose for start in load_site(site).starts if start.number == 1]
    poses = [start, *(step.world.pose for step in steps if step.world is not None)]
    reached, first = [], 0
    for leg in episode.legs:
        region = success_region(load_site(site), leg.goal, ProtocolParameters())
        last = first + leg.actions
        kept = poses[first : last if leg.end_reason == "collision" else last + 1]
        reached.append(any(region.covers(shapely.Point(pose.position)) for pose in kept))
        first = last
    rows = read(wandered.database_url, Selection()).legs
    expected = [*map(float, reached), *[0.0] * (3 - len(reached))]
    assert [row["mean_oracle_success"] for row in rows] == [*expected, float(all(expected))]
    assert measured.oracle_success is all(expected)
