"""The design of a stress test, before its first trial."""

from dataclasses import replace
from pathlib import Path

import pytest

from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import NONE, parse_disturbances
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.stress import (
    check_detects,
    condition_of,
    conditions_of,
    design_of_stress,
    power_line,
    seen_by,
    under_conditions,
    unseen_by,
    weakness_of,
)
from vsnbench.runner.setup.sweep import plan_sweep
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import load_site
from vsnbench.statistics.power import Design
from vsnbench.study.power import ASSUMED
from vsnbench.values.observation import Sensor

SETUP = TrialSetupSpec(load_site("apartment"), "vlv", ("chair,bed",))
REQUEST = RunRequest(SETUP, ResultsDirectory.locate(Path("unused"), None, {}), repetitions=2)


def of_model(name: str, **changes: object) -> RunRequest:
    return replace(REQUEST, setup=replace(SETUP, model=name, **changes))


def design(starts: int, conditions: int) -> Design:
    return Design(starts, cells=2, trials=1, rate=0.5, resemblance=ASSUMED, level=0.05 / conditions)


def test_a_design_that_can_show_no_loss_is_named_with_the_positions_that_it_needs() -> None:
    words = weakness_of(design(4, 6))
    assert "smallest possible p-value is 0.12, after correction for 6 conditions 0.75" in words
    assert "use at least 8 positions" in words
    assert weakness_of(design(1, 1))


@pytest.mark.parametrize(("starts", "conditions"), [(8, 6), (6, 1), (15, 30)])
def test_a_design_that_can_show_a_loss_is_not(starts: int, conditions: int) -> None:
    assert weakness_of(design(starts, conditions)) == ""


def test_a_test_that_is_too_small_for_the_loss_to_detect_is_refused_with_the_size_that_it_needs() -> None:
    check_detects(design(15, 1), 0.6)
    with pytest.raises(UsageError, match="starting positions instead of 15") as refused:
        check_detects(design(15, 1), 0.3)
    assert refused.value.code == "low-power"


def test_the_smallest_loss_that_a_test_shows_is_stated() -> None:
    assert power_line(design(5, 1)).startswith("this stress test shows no loss with 80 % power; 5 starting positions, ")


def test_the_design_counts_goals_positions_seeds_and_the_conditions_of_one_model() -> None:
    campaigns = plan_sweep(REQUEST, ("vlv", "random"), (0, 1), ("apartment",))
    sweep = under_conditions(campaigns, conditions_of(["blur", "latency"], (3, 5)), {"vlv": ("blur",)})
    found = design_of_stress(sweep)
    assert (found.starts, found.cells, found.trials) == (15, 2, 4)
    assert found.level == pytest.approx(0.05 / 4), "random has four conditions, vlv two"


def test_a_disturbance_that_a_model_cannot_see_is_left_out_for_that_model() -> None:
    conditions = (NONE, *(parse_disturbances([text]) for text in ("blur@3", "depth_holes@3", "latency@3")))
    unseen = unseen_by({"sees": frozenset({Sensor.RGB}), "maps": frozenset({Sensor.DEPTH})}, conditions)
    assert unseen == {"sees": ("depth_holes",), "maps": ("blur",)}
    swept = under_conditions(tuple(map(of_model, ("sees", "maps", "new"))), conditions, unseen)
    assert [(one.setup.model, one.setup.disturbances.text) for one in swept if one.setup.disturbances] == [
        *(("sees", text) for text in ("blur=4", "latency=0.3")),
        *(("maps", text) for text in ("depth_holes=0.2", "latency=0.3")),
        *(("new", text) for text in ("blur=4", "depth_holes=0.2", "latency=0.3")),
    ]


def test_a_test_in_which_no_model_sees_a_disturbance_is_refused() -> None:
    conditions = (NONE, parse_disturbances(["blur@3"]))
    with pytest.raises(UsageError) as refused:
        unseen_by({"random": frozenset(), "maps": frozenset({Sensor.DEPTH})}, conditions)
    assert refused.value.code == "unseen-disturbance"
    assert unseen_by({"sees": frozenset({Sensor.RGB}), "random": frozenset()}, conditions)["random"] == ("blur",)


def test_what_a_model_sees_is_asked_of_its_card_and_a_model_that_fails_is_left_to_its_campaigns() -> None:
    campaigns = plan_sweep(of_model("random"), ("random", "oracle"), (0,), ("apartment",))
    broken = of_model("pirlnav", model_options={"weights": "missing.pth"})
    assert seen_by((*campaigns, broken)) == {"random": frozenset(), "oracle": frozenset({Sensor.ODOMETRY})}


def test_continuous_execution_is_a_condition_by_latency_and_part_of_the_protocol() -> None:
    conditions = conditions_of(["continuous"], [1, 2, 4])
    assert [condition.text for condition in conditions] == ["", "continuous=0", "continuous=0.3", "continuous=3"]
    sweep = under_conditions((REQUEST,), conditions, {})
    paper = sweep[0].setup.parameters
    assert [each.setup.disturbances for each in sweep] == [NONE] * 4
    latencies = [each.setup.parameters.execution and each.setup.parameters.execution.latency_s for each in sweep]
    assert latencies == [None, 0.0, 0.3, 3.0]
    assert [condition_of(each.setup, paper) for each in sweep] == list(conditions)


def test_continuous_execution_is_no_disturbance_of_a_run() -> None:
    with pytest.raises(UsageError, match="--continuous SECONDS"):
        parse_disturbances(["continuous=0.3"])
