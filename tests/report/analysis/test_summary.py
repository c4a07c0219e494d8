"""A summary counts the right episodes, and its numbers match them."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.records import Attempt, Lab, measured, void
from vsnbench.errors import RecordError, UsageError
from vsnbench.protocol.judge import EndReason, Verdict
from vsnbench.protocol.metrics import ideal_time_s, sct, soft_spl, spl
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.efficiency import sct_of, soft_spl_of, spl_of
from vsnbench.report.analysis.summary import ReportResults, summarise
from vsnbench.report.build import read
from vsnbench.report.tables.activity import end_counts, end_reason_table
from vsnbench.report.tables.success import SUMMARY, goal_table
from vsnbench.results.writing.campaigns import Trial
from vsnbench.robots.profiles import load_profile
from vsnbench.values.movement import Action
from vsnbench.values.step import StepRecord, StepTimings


def results_of(lab: Lab, **selection: object) -> ReportResults:
    return summarise(read(lab.url, Selection(**selection)))  # type: ignore[arg-type]


def test_a_goal_has_its_successes_both_averages_and_its_interval(lab: Lab) -> None:
    lab.write(
        [
            Attempt(start=1, success=True, actions=20),
            Attempt(start=2, success=False, actions=40, distance_m=3.0),
            Attempt(start=3, success=False, actions=150, end_reason=EndReason.STEP_LIMIT, distance_m=2.0),
            Attempt(start=4, success=False, actions=10, end_reason=EndReason.COLLISION, distance_m=4.0),
        ]
    )
    (one,) = results_of(lab).conditions
    (goal,) = one.goals
    assert (goal.goal, goal.successes, goal.episodes) == ("chair", 1, 4)
    assert goal.success_rate == 0.25
    assert measured(goal, "mean_actions") == 55
    assert measured(goal, "mean_actions_successful") == 20
    assert measured(goal, "median_distance_to_goal_m") == 2.5
    assert (measured(goal, "collisions"), measured(goal, "step_limits")) == (1, 1)
    assert goal.interval.low < 0.25 < goal.interval.high
    assert SUMMARY.fields(one.total) == SUMMARY.fields(goal)


def test_void_attempts_are_counted_beside_and_never_inside(lab: Lab) -> None:
    lab.write([void(), void(reason=EndReason.MODEL_ERROR), Attempt(success=True)])
    total = results_of(lab).conditions[0].total
    assert (total.successes, total.episodes, measured(total, "void"), total.planned) == (1, 1, 2, 1)


def test_the_latest_verdict_stands_over_the_end_and_over_the_distance(lab: Lab) -> None:
    (number,) = lab.write([Attempt(success=True)])
    with lab.journal() as journal:
        journal.judge(number, Verdict(EndReason.COLLISION, False, "it touched the sofa"), author="Ana")
    (one,) = results_of(lab).conditions
    assert (one.total.successes, one.total.episodes, measured(one.total, "collisions")) == (0, 1, 1)
    assert [(end["end_reason"], end["counted"]) for end in end_counts(one)] == [("collision", 1)]


def test_an_attempt_made_void_by_a_verdict_is_replaced_by_the_next_attempt(lab: Lab) -> None:
    (first,) = lab.write([Attempt(success=True)])
    with lab.journal() as journal:
        journal.judge(first, Verdict(EndReason.ABORTED, None, "a visitor stood in the way"), author="Ana")
    lab.write([Attempt(success=False)])
    total = results_of(lab).conditions[0].total
    assert (total.successes, total.episodes, measured(total, "void")) == (0, 1, 1)


def test_only_the_first_result_of_a_trial_counts(lab: Lab) -> None:
    (first,) = lab.write([void()])
    lab.write([Attempt(success=False)])
    with lab.journal() as journal:  # a verdict makes the void attempt a result
        journal.judge(first, Verdict(EndReason.STOP, True, "the log shows a success"), author="Ana")
    total = results_of(lab).conditions[0].total
    assert (total.successes, total.episodes, measured(total, "void")) == (1, 1, 0)


def test_an_unjudged_result_is_in_no_rate(lab: Lab) -> None:
    lab.write([Attempt(start=1), Attempt(start=2, judged=False)])
    total = results_of(lab).conditions[0].total
    assert (total.episodes, measured(total, "unjudged"), total.planned) == (1, 1, 2)


def test_coverage_is_trials_done_of_trials_planned(lab: Lab) -> None:
    planned = [Trial(goal, start) for goal in ("chair", "bed") for start in range(1, 6)]
    lab.write([Attempt(start=1), Attempt(start=2)], trials=planned)
    (one,) = results_of(lab).conditions
    assert one.total.coverage == 0.2
    assert [(goal.goal, goal.episodes, goal.planned) for goal in one.goals] == [
        ("chair", 2, 5),
        ("bed", 0, 5),
    ]
    assert math.isnan(one.goals[1].success_rate)
    assert math.isnan(measured(one.goals[1], "mean_actions"))


def test_campaigns_that_ask_the_same_question_are_pooled_and_others_are_not(lab: Lab) -> None:
    lab.write([Attempt(success=True)], seed=1)
    lab.write([Attempt(success=False)], seed=2)
    lab.write([Attempt(success=True)], protocol=ProtocolParameters(success_distance_m=2.0))
    lab.write([Attempt(success=True)], simulated=False)
    totals = [(one.total.successes, one.total.episodes) for one in results_of(lab).conditions]
    assert totals == [(1, 2), (1, 1), (1, 1)]
    names = [one.condition.name for one in results_of(lab).conditions]
    assert len(set(names)) == 3
    assert names[2].startswith("vlv real")


def test_shared_goals_have_their_own_total(lab: Lab) -> None:
    lab.write([Attempt("chair"), Attempt("bed", success=False)], model="a")
    lab.write([Attempt("chair"), Attempt("plant", success=False)], model="b")
    for one in results_of(lab).conditions:
        assert one.shared_goals == ("chair",)
        assert one.shared is not None
        assert (one.shared.successes, one.shared.episodes) == (1, 1)


def test_goals_are_shared_by_those_that_can_be_laid_beside_each_other(lab: Lab) -> None:
    starts, goals = range(1, 9), ("chair", "sofa", "bed")
    lab.write([Attempt(goal, start) for goal in goals for start in starts], model="a")
    lab.write([Attempt(goal, start) for goal in (*goals[1:], "plant") for start in starts], model="b")
    lab.write([Attempt("sofa"), Attempt("sofa", 2)], model="a first try")
    lab.write([Attempt("bed", start) for start in range(1, 21)], model="oracle", surveyed=True)
    lab.write([Attempt("chair", start) for start in range(1, 21)], model="a", simulated=False)
    shared = {one.condition.name: (one.shared_goals, one.shared is not None) for one in results_of(lab).conditions}
    assert shared == {
        "a simulated": (("sofa", "bed"), True),
        "b": (("sofa", "bed"), True),
        "a first try": (("sofa", "bed"), False),  # not all goals are present, so a total would cover other goals
        "oracle": (("sofa", "bed"), False),
        "a real": (("chair",), False),
    }


def test_starting_positions_that_never_succeed_are_named(lab: Lab) -> None:
    lab.write([Attempt(g, start, success=start == 1) for g in ("chair", "bed") for start in (1, 2, 10)])
    (one,) = results_of(lab).conditions
    assert one.never_succeeding == (2, 10)


def test_spl_is_over_the_episodes_whose_lengths_are_known(lab: Lab) -> None:
    lab.write([Attempt(start=1, shortest_m=2.0, path_m=4.0), Attempt(start=2, shortest_m=None)])
    total = results_of(lab).conditions[0].total
    assert (measured(total, "spl"), measured(total, "spl_episodes")) == (0.5, 1)


def test_a_report_on_the_terminal_loads_neither_pandas_nor_what_other_outputs_need(lab: Lab) -> None:
    lab.write([Attempt(start=1), Attempt(start=2, success=False)])
    code = (
        "import sys\n"
        "from vsnbench.cli.main import main\n"
        "sys.argv = ['vsnbench', 'report', '--db', sys.argv[1]]\n"
        "main(lambda: __import__('atexit').register(lambda: sys.stderr.write(' '.join(sys.modules))))"
    )
    run = subprocess.run([sys.executable, "-c", code, lab.url], capture_output=True, text=True, check=True)
    assert "chair" in run.stdout
    outputs = {"vsnbench.report.formats.json", "vsnbench.report.formats.html"}
    others = {"pandas", "shapely", "ruamel.yaml", "psutil", "matplotlib", "cv2"}
    assert (outputs | others) & set(run.stderr.split()) == set()


LENGTHS = st.one_of(st.just(0.0), st.floats(0.0, 50.0))


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.booleans(), LENGTHS, LENGTHS, LENGTHS), min_size=1, max_size=20))
def test_the_columns_of_spl_agree_with_the_protocol(rows: list[tuple[bool, float, float, float]]) -> None:
    names = ("success", "shortest_m", "remaining_m", "path_m")
    columns = {name: np.array(values) for name, values in zip(names, zip(*rows, strict=True), strict=True)}
    assert list(sct_of(columns, 0.5, columns["path_m"])) == pytest.approx(
        [sct(ok, ideal_time_s(shortest, 0.5), taken_s) for ok, shortest, _, taken_s in rows]
    )
    assert list(spl_of(columns)) == pytest.approx([spl(ok, shortest, path) for ok, shortest, _, path in rows])
    assert list(soft_spl_of(columns)) == pytest.approx(
        [soft_spl(shortest, left, path) for _, shortest, left, path in rows]
    )


def test_a_record_without_campaigns_is_one_clear_line(lab: Lab) -> None:
    lab.journal().close()
    with pytest.raises(RecordError, match="holds no campaign to report"):
        read(lab.url, Selection())


def test_a_selection_that_fits_nothing_says_what_there_is(lab: Lab) -> None:
    lab.write([Attempt()])
    with pytest.raises(UsageError, match=r"model 'pirlnav' is not in this record. It has vlv."):
        read(lab.url, Selection(models=("pirlnav",)))
    with pytest.raises(UsageError, match=r"goal 'sofa' is not in this record. It has chair."):
        read(lab.url, Selection(goals=("sofa",)))


def test_a_campaign_with_no_valid_episode_is_a_report_of_nothing_done(lab: Lab) -> None:
    lab.write([void()])
    (one,) = results_of(lab).conditions
    assert (one.total.episodes, measured(one.total, "void"), one.total.coverage) == (0, 1, 0.0)
    assert math.isnan(one.total.interval.low)


def test_a_failure_counts_0_in_spl_whatever_is_known_of_its_path(lab: Lab) -> None:
    lab.write(
        [
            Attempt(start=1, shortest_m=2.0, path_m=4.0),
            Attempt(start=2, success=False, shortest_m=None),
            Attempt(start=3, shortest_m=0.1, path_m=None),
        ]
    )
    total = results_of(lab).conditions[0].total
    assert (measured(total, "spl"), measured(total, "spl_episodes"), measured(total, "soft_spl_episodes")) == (
        0.25,
        2,
        1,
    )
    assert measured(total, "trivial") == 1
    notes = " ".join(goal_table(results_of(lab).conditions[0]).notes)
    assert "SPL is over 2 episodes; the path length of 1 success is unknown" in notes
    assert "SoftSPL is over 1 episode with known path length." in notes
    assert "1 episode is trivial: it began within" in notes


def test_failures_alone_do_not_make_a_path_efficiency(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([Attempt(path_m=None), Attempt(start=2, success=False)])
    (one,) = summarise(read(lab.url, Selection())).conditions
    assert math.isnan(measured(one.total, "spl"))
    assert "SPL is unknown: no successful episode has a recorded path length (n = 1)." in goal_table(one).notes
    lab.write([Attempt(start=s, success=False, path_m=None) for s in (1, 2)], model="failing")
    failing = summarise(read(lab.url, Selection())).conditions[1]
    assert measured(failing.total, "spl") == 0


def test_what_never_counts_has_no_share_of_what_counts(tmp_path: Path) -> None:
    lab = Lab(tmp_path)
    lab.write([void(), Attempt()])
    rows = {row.cells[1].text: [cell.text for cell in row.cells] for row in end_reason_table(results_of(lab)).rows}
    assert rows["motion_failed"][2:5] == ["1", "0", "–"]
    assert rows["stop"][2:5] == ["1", "1", "100.00"]


def thinking(*seconds: float | None) -> list[StepRecord]:
    steps = enumerate(seconds, start=1)
    return [StepRecord(number, Action.TURN_LEFT, timings=StepTimings(infer_s=infer_s)) for number, infer_s in steps]


def test_sct_is_the_ideal_time_over_driving_and_on_a_real_robot_thinking(lab: Lab) -> None:
    speed = load_profile("turtlebot2").base.max_linear_m_s
    attempts = [
        Attempt(start=1, shortest_m=3.0, duration_s=30.0, steps=thinking(4.0, 6.0)),
        Attempt(start=2, shortest_m=3.0, duration_s=30.0, success=False),
        Attempt(start=3, shortest_m=3.0, duration_s=None, steps=thinking(1.0)),
    ]
    lab.write(attempts)
    lab.write([*attempts, Attempt(start=4, steps=thinking(1.0, None))], simulated=False)
    simulated, real = (one.total for one in results_of(lab).conditions)
    assert (measured(simulated, "sct"), measured(simulated, "sct_episodes")) == (pytest.approx(3.0 / speed / 30 / 2), 2)
    assert (measured(simulated, "mean_driving_s"), math.isnan(measured(simulated, "mean_thinking_s"))) == (30.0, True)
    assert (measured(real, "sct"), measured(real, "sct_episodes")) == (pytest.approx(3.0 / speed / 40 / 2), 2)
    assert (measured(real, "mean_driving_s"), measured(real, "mean_thinking_s")) == (30.0, 5.5)


def test_every_limit_is_counted_and_the_table_has_their_sum(lab: Lab) -> None:
    ends = (EndReason.STEP_LIMIT, EndReason.TIME_LIMIT, EndReason.TIME_LIMIT, EndReason.PATH_LIMIT)
    lab.write([Attempt(start=start, success=False, end_reason=end) for start, end in enumerate(ends, start=1)])
    (one,) = results_of(lab).conditions
    assert [measured(one.total, f"{limit}_limits") for limit in ("step", "time", "path")] == [1, 2, 1]
    assert [(end["end_reason"], end["counted"]) for end in end_counts(one)] == [
        ("step_limit", 1),
        ("time_limit", 2),
        ("path_limit", 1),
    ]
    assert "void" not in " ".join(cell.text for line in end_reason_table(results_of(lab)).rows for cell in line.cells)
