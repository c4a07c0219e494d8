"""Sensitivity analyses, in records with known results."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.records import Attempt, Lab, step
from vsnbench.protocol.execution import Execution
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.episodes_frame import ReportData
from vsnbench.report.analysis.failures import FailureKind, read_failures
from vsnbench.report.analysis.judgements import read_judgements
from vsnbench.report.analysis.sensitivity import by_distance, by_seed, drift, grid, sensitivity, spread_between
from vsnbench.report.analysis.summary import ConditionSummary, summarise
from vsnbench.report.build import build, read
from vsnbench.report.tables.failures import JUDGEMENTS, failure_table, judgement_table, narrative_table
from vsnbench.report.tables.sensitivity import sensitivity_tables
from vsnbench.results.writing.campaigns import Trial
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

STARTS = range(1, 16)


def only(lab: Lab) -> tuple[ReportData, ConditionSummary]:
    record = read(lab.url, Selection())
    (one,) = summarise(record).conditions
    return record, one


def test_rates_are_counted_anew_under_other_rules(lab: Lab) -> None:
    lab.write(
        [
            Attempt(start=1, distance_m=0.3, actions=40),
            Attempt(start=2, distance_m=0.7, actions=90, shortest_m=0.1),
            Attempt(start=3, distance_m=1.1, success=False),
            Attempt(start=4, distance_m=0.9, success=False),  # near, but through a wall
            Attempt(start=5, distance_m=0.2, success=False, end_reason=EndReason.COLLISION),
        ],
        trials=[Trial("chair", start) for start in range(1, 8)],
    )
    counted = {each.label: each.proportion for each in sensitivity(*only(lab))}
    shown = {what: (each.successes, each.trials) for what, each in counted.items()}
    assert shown == {
        "as judged": (2, 5),
        "without trivial trials": (1, 4),
        "success under 0.5 m": (1, 5),
        "success under 0.75 m": (2, 5),
        "success under 1.25 m": (3, 5),
        "success under 1.5 m": (3, 5),
        "at most 50 actions": (1, 5),
        "at most 100 actions": (2, 5),
        "missing trials all fail": (2, 7),
        "missing trials all succeed": (4, 7),
    }


@pytest.mark.parametrize(
    "protocol",
    [ProtocolParameters().driven_by_stack(), ProtocolParameters().executed(Execution(latency_s=0.3, frames_hz=5))],
    ids=["stack", "continuous"],
)
def test_a_robot_that_drives_on_has_no_limit_of_actions(lab: Lab, protocol: ProtocolParameters) -> None:
    lab.write([Attempt(start=start, actions=400, distance_m=0.4) for start in (1, 2, 3)], protocol=protocol)
    record, summary = only(lab)
    assert {known.label: known.proportion.successes for known in sensitivity(record, summary)} == {
        "as judged": 3,
        **{f"success under {within_m} m": 3 for within_m in ("0.5", "0.75", "1.25", "1.5")},
    }
    assert (summary.condition.max_actions, summary.condition.max_time_s) == (None, 300.0)


def test_no_threshold_reaches_through_a_wall(lab: Lab) -> None:
    lab.write([Attempt(start=1), Attempt(start=2, distance_m=1.1, success=False, in_sight=False)])
    counted = {each.label: each.proportion.successes for each in sensitivity(*only(lab))}
    assert counted["success under 1.25 m"] == counted["as judged"] == 1


def test_a_distance_that_nobody_measured_is_under_no_threshold(lab: Lab) -> None:
    lab.write([Attempt(start=1), Attempt(start=2, distance_m=None)])
    assert not any(each.label.startswith("success under") for each in sensitivity(*only(lab)))


def test_success_by_distance_sets_trivial_trials_apart(lab: Lab) -> None:
    lab.write([Attempt(start=s, shortest_m=0.1 * s * s, success=s < 7) for s in range(1, 9)])
    groups = {each.label: (each.proportion.successes, each.proportion.trials) for each in by_distance(*only(lab))}
    assert groups == {
        "0 to 0.25 m, trivial": (1, 1),
        "0.25 to 2 m": (3, 3),
        "2 to 4 m": (2, 2),
        "4 to 6 m": (0, 1),
        "6 m and more": (0, 1),
    }


def test_each_seed_has_its_rate(lab: Lab) -> None:
    for seed, successes in ((3, 9), (7, 3)):
        lab.write([Attempt(start=s, success=s <= successes) for s in STARTS], seed=seed)
    seeds = by_seed(*only(lab))
    assert [(each.label, each.proportion.successes) for each in seeds] == [("3", 9), ("7", 3)]
    assert spread_between(seeds) == pytest.approx(math.sqrt(2) * 0.2)


def test_one_seed_has_no_spread(lab: Lab) -> None:
    lab.write([Attempt(start=s) for s in STARTS])
    assert by_seed(*only(lab)) == ()


def test_a_session_that_wears_out_drifts_and_goals_in_turn_do_not(lab: Lab, tmp_path: Path) -> None:
    lab.write([Attempt(start=s, success=s <= 7) for s in STARTS], simulated=False)
    worn = drift(*only(lab))
    assert worn is not None
    assert [each.proportion.successes for each in worn.thirds] == [5, 2, 0]
    assert worn.trend.p == pytest.approx(2 / math.comb(15, 7))
    assert worn.difference == -1
    assert worn.interval.high < 0
    assert drift(*only(lab), whole=True) is None, "a single session has all episodes"
    (tmp_path / "turn").mkdir()
    turn = Lab(tmp_path / "turn")
    turn.write([Attempt(goal, s, success=goal == "bed") for goal in ("bed", "plant") for s in range(1, 9)])
    in_turn = drift(*only(turn))
    assert in_turn is not None
    assert in_turn.trend.p == 1.0  # the plant is harder, and its trials came later


def test_the_grid_has_every_cell_that_was_tried(lab: Lab) -> None:
    lab.write([Attempt("bed", 1, r, success=r == 1) for r in (1, 2)] + [Attempt("plant", 2)])
    _, one = only(lab)
    cells = grid(one)
    assert (cells.goals, cells.starts) == (("bed", "plant"), (1, 2))
    assert {place: (each.successes, each.trials) for place, each in cells.cells.items()} == {
        ("bed", 1): (1, 2),
        ("plant", 2): (1, 1),
    }


def course(*places: Pose, blocked: bool = False) -> list:
    """Return steps that end at these positions of the site."""
    return [
        replace(
            step(number, Action.MOVE_FORWARD, blocked=blocked),
            result=None if blocked else MotionResult(completed=True, pose=Pose(0, 0)),
            world=Fix(place, PoseSource.SIMULATED),
        )
        for number, place in enumerate(places, start=1)
    ]


def test_failures_are_sorted_by_what_was_seen_and_done(lab: Lab) -> None:
    bed = lab.site.instances("bed")[0]
    room = next(room for room in lab.site.rooms if room.shape.contains(bed.shape.centroid))
    centre = room.shape.centroid
    towards = math.atan2(bed.shape.centroid.y - centre.y, bed.shape.centroid.x - centre.x)
    facing, away = Pose(centre.x, centre.y, towards), Pose(centre.x, centre.y, towards + math.pi)
    long_way = EndReason.STEP_LIMIT
    failed = {"success": False}
    touch = replace(
        course(away)[0],
        result=MotionResult(completed=False, collision=Collision(CollisionSource.CONTACT, "sofa-1"), pose=Pose(0, 0)),
    )
    lab.write(
        [
            Attempt("bed", 1, end_reason=EndReason.COLLISION, steps=[touch], **failed),
            Attempt("bed", 2, distance_m=1.4, steps=course(facing), **failed),
            Attempt("bed", 3, distance_m=4.0, steps=course(away), **failed),
            Attempt("bed", 4, end_reason=long_way, distance_m=3, steps=course(*[away] * 40, blocked=True), **failed),
            Attempt("bed", 5, end_reason=long_way, distance_m=3, steps=[], **failed),
            Attempt("bed", 6),
        ]
    )
    record = read(lab.url, Selection())
    (found,) = read_failures(lab.engine(), record)
    kinds = found["kinds"]
    assert found["failed"] == found["examined"] == 5
    assert kinds[FailureKind.COLLISION] == kinds[FailureKind.STOPPED_EARLY] == kinds[FailureKind.STOPPED_FAR] == 1
    assert found["touched"] == {"sofa-1": 1}
    table = failure_table(summarise(record), [found])
    assert table is not None
    assert any("collided with: sofa-1 1" in note for note in table.notes)
    examples = {example["kind"]: example for example in found["examples"]}
    assert set(examples) == set(kinds)
    assert examples[FailureKind.STOPPED_FAR]["words"].startswith(
        "bed from starting position 3: 10 actions over 2.0 m, ended by stop, 4.00 m from the goal"
    )
    assert examples[FailureKind.COLLISION]["words"].endswith("touching sofa-1.")
    narrative = narrative_table(summarise(record), [found])
    assert narrative is not None
    assert [row.cells[2].text for row in narrative.rows] == [f"{kinds[kind]}/5" for kind in examples]
    assert narrative.rows[0].cells[3].links == (found["examples"][0]["episode"],)


@pytest.mark.parametrize(
    ("faces", "refused", "kind"),
    [
        (True, False, FailureKind.NOT_APPROACHED),
        (False, False, FailureKind.NEVER_SEEN),
        (True, True, FailureKind.STUCK),
    ],
)
def test_an_episode_that_reached_the_cap_had_seen_the_goal_or_not(
    lab: Lab, faces: bool, refused: bool, kind: FailureKind
) -> None:
    bed = lab.site.instances("bed")[0].shape
    room = next(room for room in lab.site.rooms if room.shape.contains(bed.centroid))
    x_min, y_min, x_max, y_max = room.shape.bounds
    corners = [Pose(x, y) for x in (x_min + 0.3, x_max - 0.3) for y in (y_min + 0.3, y_max - 0.3)]
    place = max(corners, key=lambda corner: math.dist(corner.position, (bed.centroid.x, bed.centroid.y)))
    towards = math.atan2(bed.centroid.y - place.y_m, bed.centroid.x - place.x_m)
    stands = Pose(place.x_m, place.y_m, towards if faces else towards + math.pi)
    steps = course(*[stands] * 40, blocked=refused)
    attempt = Attempt("bed", 1, success=False, end_reason=EndReason.STEP_LIMIT, distance_m=2.0, steps=steps)
    lab.write([replace(attempt, begins=stands)])
    (found,) = read_failures(lab.engine(), read(lab.url, Selection()))
    assert found["kinds"] == {kind: 1}
    assert found["never_in_view"] == (0 if faces else 1)


def test_who_overruled_the_protocol_is_said(lab: Lab) -> None:
    first, second, _ = lab.write([Attempt(start=s) for s in (1, 2, 3)])
    with lab.journal() as journal:
        journal.judge(first, Verdict(EndReason.COLLISION, False, "it touched the sofa"), author="Ana")
        journal.judge(second, Verdict(EndReason.STOP, True, "seen"), author="Ben")
    record = read(lab.url, Selection())
    (found,) = read_judgements(lab.engine(), record)
    assert (found["judged"], JUDGEMENTS.fields({**found, "model": "vlv"})["overrule_rate"]) == (2, 0.5)
    (change,) = found["overruled"]
    assert change == {
        "episode": first,
        "before": True,
        "after": False,
        "author": "Ana",
        "reason": "it touched the sofa",
    }
    table = judgement_table(summarise(record), [found])
    assert table is not None
    assert "a failure by Ana: it touched the sofa" in table.notes[0]


def test_the_whole_report_has_what_the_record_supports(lab: Lab) -> None:
    for seed in (0, 1):
        lab.write([Attempt(g, s, success=s < 8) for g in ("bed", "plant") for s in STARTS], seed=seed)
    report = build(lab.url, Selection())
    names = [table.name for table in report.tables(long=True)]
    assert {"sensitivity", "distances", "seeds", "grid-1", "failures"} <= set(names)
    assert "drift" not in names  # a simulator has no drift
    assert "judgements" not in names
    record, results = report.record, report.results
    assert all(table.rows for table in sensitivity_tables(record, results))
