"""Poses measured after STOP: kept beside the placement, merged, judged by another answer, and in the report."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import select

from tests.results.records_of_a_lab import SITE_TEXT, complete, plan, stopped
from tests.results.writing.test_sessions import MEASURED, set_operator
from vsnbench.interop.merge import merge, merge_source
from vsnbench.protocol.judge import GoalDistance, judge
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.stop_pose import StopPose
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.build import build
from vsnbench.report.formats.json import to_json
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import episode_record, list_episodes
from vsnbench.results.schema.placement_tables import Placement
from vsnbench.results.writing.deletion import delete_for_good
from vsnbench.results.writing.entries import EpisodeEnd
from vsnbench.results.writing.journal import Journal
from vsnbench.runner.judging.case import Case
from vsnbench.runner.judging.decision import Answer, AnswerKind, UnconfirmedAnswerError, decide
from vsnbench.runner.operator.answers import MisreadError
from vsnbench.sites.site import parse_site
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.placement import PlacementMethod
from vsnbench.values.pose import Pose

PLACEMENT = replace(
    MEASURED, start=0, mark=Pose(1.5, 1.0, 0.0), pose=Pose(1.5, 1.06, 0.03), method=PlacementMethod.DRIVE
)
STOP = StopPose(
    placement=PLACEMENT,
    odometry=GoalDistance(0.87, PoseSource.ESTIMATED, "chair_1", range_m=(0.5, math.inf)),
    measured=GoalDistance(1.06, PoseSource.MEASURED, "chair_1", range_m=(1.02, 1.1)),
    success_distance_m=1.0,
)
UNKNOWN = replace(STOP, placement=replace(PLACEMENT, undetermined=("left-right",)), measured=None)


CHAIR = "objects: [{id: chair_1, category: chair, position: [3, 1], size_m: [0.5, 0.5, 0.9]}]\n"
ROOM = parse_site(f"{SITE_TEXT}{CHAIR}", "cell.yaml")


def ended(stop: StopPose, path_m: float = 3.0) -> EpisodeEnd:
    end = stopped(success=True)
    verdict = judge(end.end_reason, 3, stop.judged, ProtocolParameters())
    return replace(end, verdict=verdict, final=stop.fix, stop=stop, proposed=True, path_m=path_m)


def record(directory: Path, *ends: EpisodeEnd) -> ResultsDirectory:
    results = ResultsDirectory.locate(directory, None)
    results.prepare()
    with Journal.open(sqlite_url(results.path / "vsnbench.db")) as journal:
        trials = journal.find_or_create_campaign(replace(plan(), site=ROOM)).trials
        for trial, end in zip(trials, ends, strict=False):
            complete(journal, set_operator(journal, trial, "Ana"), end)
    return results


def test_it_is_kept_beside_the_placement_and_names_the_source_of_the_judged_pose(url: str) -> None:
    with Journal.open(url) as journal:
        trial = journal.find_or_create_campaign(plan()).trials[0]
        number = complete(journal, set_operator(journal, trial, "Ana"), ended(STOP)).id
        kept = episode_record(journal.engine, number)
    assert kept.measured is not None
    assert kept.measured.words == MEASURED.headline
    stop = kept.stopped
    assert stop is not None
    assert (stop.distance_m, stop.distance_low_m, stop.distance_high_m) == (1.06, 1.02, 1.1)
    assert (stop.odometry_m, stop.odometry_low_m, stop.odometry_high_m) == (0.87, 0.5, None)
    assert stop.verdicts_differ
    assert stop.pose == Fix(PLACEMENT.pose, PoseSource.MEASURED)
    assert stop.method == "drive"
    assert stop.words == STOP.text
    assert (kept.final, kept.distance_source) == (STOP.fix, "measured")


def test_an_unknown_pose_leaves_the_odometry_judged(tmp_path: Path) -> None:
    results = record(tmp_path, ended(UNKNOWN))
    with Journal.open(results.database_url) as journal:
        kept = episode_record(journal.engine, 1)
    assert kept.stopped is not None
    assert (kept.stopped.distance_m, kept.stopped.verdicts_differ) == (None, False)
    assert kept.stopped.undetermined == ("left-right",)
    assert (kept.distance_m, kept.distance_source) == (0.87, "estimated")


def test_a_merge_brings_both_measurements_once(tmp_path: Path) -> None:
    ours = record(tmp_path / "ours")
    record(tmp_path / "theirs", ended(STOP))
    for _ in range(2):
        merge(ours, [merge_source(str(tmp_path / "theirs"))], without_images=True)
    with Journal.open(ours.database_url) as journal:
        (number,) = [episode.id for episode in list_episodes(journal.engine, EpisodeFilter())]
        kept = episode_record(journal.engine, number)
    assert kept.measured is not None
    assert kept.stopped is not None
    assert kept.stopped.words == STOP.text


def test_a_deletion_removes_both_measurements_and_its_backup_has_them(tmp_path: Path) -> None:
    results = record(tmp_path, ended(STOP))
    _, aside = delete_for_good(results, [1], [], author="Ana", reason="a mistake")
    with Journal.open(sqlite_url(aside / "vsnbench.db")) as backup:
        kept = episode_record(backup.engine, 1)
    assert kept.measured is not None
    assert kept.stopped is not None
    with Journal.open(results.database_url) as journal, journal.engine.connect() as connection:
        assert connection.execute(select(Placement.id)).all() == []


def test_the_operator_can_answer_that_the_odometry_is_right(tmp_path: Path) -> None:
    results = record(tmp_path, ended(STOP), ended(UNKNOWN))
    with Journal.open(results.database_url) as journal:
        case, unknown = (Case.of_recorded(episode_record(journal.engine, number)) for number in (1, 2))
    assert case.odometry is not None
    assert case.odometry.source is PoseSource.ESTIMATED
    assert case.odometry.distance_m == pytest.approx(1.25), "from where the odometry has the robot"
    assert case.odometry.range_m == (0.5, math.inf)
    answer = Answer(AnswerKind.MEASURED, "Odometry")
    given = replace(case, odometry=STOP.odometry)
    with pytest.raises(UnconfirmedAnswerError, match=r"odometry 0\.87 m, estimated 1\.06 m"):
        decide(given, answer)
    verdict = decide(given, replace(answer, is_confirmed=True)).verdict
    assert (verdict.success, verdict.distance) == (True, STOP.odometry)
    assert decide(case, Answer(AnswerKind.CONFIRM)).verdict.success is False, "by the measured pose"
    with pytest.raises(MisreadError, match="no other pose"):
        decide(unknown, answer)


def test_the_report_has_the_drift_of_the_odometry_and_the_episodes_it_misjudges(tmp_path: Path) -> None:
    near = replace(STOP, measured=replace(STOP.measured or STOP.odometry, distance_m=0.9))
    results = record(tmp_path, ended(STOP), ended(near, path_m=2.0), ended(UNKNOWN), ended(near, path_m=0.5))
    report = build(results.database_url, Selection(), results.path)
    assert report.activity is not None
    (robot,) = json.loads(to_json(report.results, report.questions, report.activity, report.record))["odometry"]
    assert (robot["stops"], robot["measured"], robot["differing"]) == (4, 3, [1])
    assert robot["drift_per_m"] == pytest.approx((0.06 / 3 + 0.06 / 2) / 2), "a path under 1 m tells nothing"
    assert robot["drift_m_max"] == pytest.approx(0.06)
    table = next(table for table in report.tables() if table.name == "odometry")
    assert table.notes[0].endswith("give different verdicts of 1 trial: 1; 1 of them await judgement.")
