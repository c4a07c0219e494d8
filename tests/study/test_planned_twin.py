"""A planned twin: real cells drawn at random, and the primary rate predicted from simulated trials run before."""

import pytest

from tests.report.study.test_primary import standing
from tests.study.studies import small_study
from vsnbench.errors import StudyError
from vsnbench.report.study.primary import analyse
from vsnbench.statistics.clustered import Cell
from vsnbench.statistics.prediction_powered import OnlyPredicted, PredictedCell, powered
from vsnbench.study.schedule import draw_schedule

RATE = {"primary": {"kind": "rate", "arm": "one", "rate": 0.5}}
PLACES = [(goal, start) for goal in ("bed", "chair") for start in range(1, 16)]


def test_the_real_cells_are_drawn_by_the_seed_and_every_arm_has_them() -> None:
    drawn = []
    for seed in (1, 1, 2):
        schedule = draw_schedule(small_study(**RATE, real_cells=12, seed=seed), range(1, 16))
        by_arm = [
            {(trial.goal, trial.start) for trial in schedule.trials if trial.arm == arm} for arm in ("one", "two")
        ]
        assert by_arm[0] == by_arm[1]
        assert len(by_arm[0]) == 12
        drawn.append(by_arm[0])
    assert drawn[0] == drawn[1] != drawn[2]
    with pytest.raises(StudyError) as refused:
        draw_schedule(small_study(**RATE, real_cells=30), range(1, 16))
    assert refused.value.code == "no-twin-cells"


def test_the_primary_rate_is_powered_by_the_twin_or_says_why_not() -> None:
    study = small_study(**RATE, real_cells=16, alpha=0.1)
    real = standing(study, 15, lambda _arm, _goal, start: start % 2 == 0)
    twin = {place: float(place[1] % 2 == 0) for place in PLACES}
    primary = analyse(study, real, twin)
    (answer,) = primary.answers
    known = {(trial.trial.goal, trial.trial.start): trial for trial in real if trial.arm == "one"}
    driven = [PredictedCell(_cell(known[place].success, place[1]), twin[place]) for place in PLACES if place in known]
    others = [OnlyPredicted(place[1], twin[place]) for place in PLACES if place not in known]
    expected = powered(driven, others, 0.9)
    assert expected is not None
    assert expected.saved > 0
    assert (answer.difference, answer.low, answer.high) == pytest.approx(
        (expected.rate, expected.interval.low, expected.interval.high)
    )
    assert f"saves an estimated {expected.saved:.1f} real cells beside the 16 that were run" in primary.method
    plain = analyse(study, real, {})
    assert plain.method.endswith("has no results in these cells from before the first real trial")
    assert plain.answers[0].high - plain.answers[0].low > answer.high - answer.low


def _cell(success: bool | None, start: int) -> Cell:
    return Cell(start, int(bool(success)), 1)
