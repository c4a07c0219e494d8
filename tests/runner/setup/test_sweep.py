import logging
import math
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from vsnbench.errors import SiteError, UsageError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.results.reading.throughput import NO_THROUGHPUT, Throughput
from vsnbench.results.writing.campaigns import protocol_sha256
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.loop.contract import Session
from vsnbench.runner.operator.contract import AbsentOperator, Operator
from vsnbench.runner.operator.provider import OperatorProvider
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.selection import named_site
from vsnbench.runner.setup.stress import conditions_of, under_conditions
from vsnbench.runner.setup.sweep import (
    NEXT_STARTUP_S,
    STARTUP_S,
    UNKNOWN_PACE_S,
    cost_of,
    plan_sweep,
    run_sweep,
    undone,
)
from vsnbench.runner.setup.sweep_timing import time_models
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.runner.stopping.requests import Stopped
from vsnbench.sites.site import load_site

SETUP = TrialSetupSpec(load_site("apartment"), "forward", ("chair",), keep=KeepFiles.IMAGES)
PROTOCOL = protocol_sha256(SETUP.parameters)
REQUEST = RunRequest(SETUP, ResultsDirectory.locate(Path("nowhere"), None, {}), workers=WorkerOptions(2))


def asked_for(request: RunRequest = REQUEST, **changes: object) -> RunRequest:
    return replace(request, setup=replace(request.setup, **changes))


def test_a_sweep_has_every_combination_and_seeds_vary_slowest() -> None:
    sweep = plan_sweep(REQUEST, ("forward", "random"), (0, 1, 5), ("apartment", "flat:3", "flat:4", "flat:9"))
    assert [(one.seed, one.site, one.setup.model) for one in sweep] == [
        (seed, site, model)
        for seed in (0, 1, 5)
        for site in ("apartment", "flat:3", "flat:4", "flat:9")
        for model in ("forward", "random")
    ]
    assert {request.site_name for request in sweep} == {"apartment", "flat-3", "flat-4", "flat-9"}
    assert all(15 <= request.max_trials <= 18 for request in sweep)


def test_a_generated_site_has_its_own_name() -> None:
    assert named_site("flat:3").name == "flat-3"
    assert named_site("apartment").name == "apartment"


@pytest.mark.parametrize(
    ("models", "seeds", "sites", "reason"),
    [
        (("forward", "typo"), (0,), ("apartment",), "no model 'typo'"),
        (("forward",), range(100_000), tuple(f"flat:{seed}" for seed in range(10)), "more than 100,000"),
        (("forward",), (0,), ("nowhere",), "site 'nowhere' does not exist"),
    ],
)
def test_an_invalid_sweep_is_refused_before_anything_runs(
    models: Sequence[str], seeds: Sequence[int], sites: Sequence[str], reason: str
) -> None:
    with pytest.raises((UsageError, SiteError), match=reason):
        plan_sweep(REQUEST, models, seeds, sites)


def test_a_sweep_refuses_real_robots_and_options_of_one_model() -> None:
    with pytest.raises(UsageError) as refused:
        plan_sweep(asked_for(robot="turtlebot2"), ("forward",), (0, 1), ("apartment",))
    assert refused.value.code == "real-robot"
    with pytest.raises(UsageError, match="--weights is for one model"):
        plan_sweep(asked_for(model_options={"weights": "x"}), ("forward", "random"), (0,), ("apartment",))
    with pytest.raises(UsageError) as refused:
        plan_sweep(asked_for(goals=("zebra",)), ("forward",), (0, 1), ("apartment",))
    assert refused.value.code == "unknown-goal"


def test_the_estimate_uses_recorded_times_and_the_trials_left() -> None:
    sweep = plan_sweep(REQUEST, ("forward", "random"), (0, 1), ("apartment",))
    guessed = cost_of(sweep, NO_THROUGHPUT)
    assert (guessed.campaigns, guessed.trials, guessed.done, guessed.known_from) == (4, 60, 0, 0)
    assert math.isclose(guessed.seconds, 60 * UNKNOWN_PACE_S / 2 + STARTUP_S + 3 * NEXT_STARTUP_S)
    pace = Throughput(
        {"forward": (1.0, 40), "random": (5.0, 9)}, {("forward", "apartment", 0, "", PROTOCOL, "chair"): 15}
    )
    known = cost_of(sweep, pace)
    assert (known.trials, known.done, known.known_from) == (60, 15, 49)
    assert math.isclose(known.seconds, (15 * 1.0 + 30 * 5.0) / 2 + STARTUP_S + 3 * NEXT_STARTUP_S)


def test_a_stress_test_pairs_every_campaign_with_its_disturbances() -> None:
    conditions = conditions_of(["glare", "blur"], (5, 1))
    assert [condition.text for condition in conditions] == ["", "glare=0.2", "glare=1", "blur=1", "blur=10"]
    sweep = under_conditions(plan_sweep(REQUEST, ("forward", "random"), (0,), ("apartment",)), conditions, {})
    assert [(request.setup.model, request.setup.disturbances.text) for request in sweep[4:7]] == [
        ("forward", "blur=10"),
        ("random", ""),
        ("random", "glare=0.2"),
    ]
    done = {
        ("forward", "apartment", 0, "", PROTOCOL, "chair"): 15,
        ("random", "apartment", 0, "blur=1", PROTOCOL, "chair"): 4,
        ("random", "apartment", 0, "blur=1", PROTOCOL, "bed"): 5,
        ("random", "apartment", 0, "blur=1", "another execution", "chair"): 6,
    }
    cost = cost_of(sweep, Throughput({}, done))
    assert (cost.campaigns, cost.trials, cost.done) == (10, 150, 19)


def test_the_standard_stress_test_has_eight_disturbances_at_three_severities() -> None:
    conditions = conditions_of((), ())
    assert len(conditions) == len(set(conditions)) == 25
    assert not conditions[0]


@pytest.mark.parametrize(
    ("names", "severities", "code"),
    [
        (("blurr",), (), "unknown-disturbance"),
        (("blur=2",), (), "invalid-disturbance"),
        (("blur@2",), (), "invalid-disturbance"),
        (("blur", "blur"), (), "duplicate-disturbance"),
        (("blur",), (9,), "invalid-severity"),
        (("blur",), (0,), "invalid-severity"),
    ],
)
def test_an_invalid_stress_test_is_refused(names: Sequence[str], severities: Sequence[int], code: str) -> None:
    with pytest.raises(UsageError) as refused:
        conditions_of(names, severities)
    assert refused.value.code == code


def test_several_generated_sites_may_lack_a_goal_that_some_have() -> None:
    asked = replace(asked_for(goals=("bathtub,chair",)), starts=(1,))
    lacking = "flat:3"
    assert "bathtub" not in named_site(lacking).categories
    assert [request.max_trials for request in plan_sweep(asked, ("forward",), (0,), (lacking, "flat:0"))] == [2, 2]
    with pytest.raises(UsageError) as refused:
        plan_sweep(asked, ("forward",), (0, 1), (lacking,))
    assert refused.value.code == "unknown-goal"


def test_a_goal_that_no_generated_site_has_is_refused_before_anything_runs() -> None:
    with pytest.raises(UsageError) as refused:
        plan_sweep(asked_for(goals=("chair", "zebra")), ("forward",), (0,), ("flat:3", "flat:0"))
    assert refused.value.code == "unknown-goal"


def test_a_sweep_skips_what_a_generated_site_lacks_and_runs_the_rest(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    results = ResultsDirectory.locate(tmp_path / "results")
    asked = replace(asked_for(parameters=ProtocolParameters(max_actions=1)), results=results, starts=(1,))
    operators = OperatorProvider(unattended=True)
    with caplog.at_level(logging.WARNING):
        both = replace(asked_for(asked, goals=("bathtub", "chair")), workers=WorkerOptions(1))
        swept = list(run_sweep(plan_sweep(both, ("forward",), (0,), ("flat:3", "flat:0")), operators))
        assert [each.session.trials for each in swept if each.session] == [1, 2]
        only = asked_for(both, goals=("bathtub",))
        sweep = plan_sweep(only, ("forward",), (0,), ("flat:3", "flat:0"))
        assert not time_models(sweep, NO_THROUGHPUT, operators).seconds, "the first site has no trial to time"
        swept = list(run_sweep(sweep, operators))
    assert [each.is_skipped for each in swept] == [True, False]
    assert undone(swept) == (0, 0)
    assert sum("bathtub" in record.getMessage() for record in caplog.records) == 2, "one line for each campaign"


def test_ctrl_c_after_the_last_trial_of_a_campaign_ends_the_sweep(tmp_path: Path) -> None:
    sessions: list[Session] = []

    class InterruptedOperators(OperatorProvider):
        @contextmanager
        def attend(self, session: Session) -> Iterator[Operator]:
            sessions.append(session)
            yield AbsentOperator()
            os.kill(os.getpid(), signal.SIGINT)

    results = ResultsDirectory.locate(tmp_path / "results")
    one_trial = replace(asked_for(parameters=ProtocolParameters(max_actions=1)), results=results, starts=(1,))
    sweep = plan_sweep(replace(one_trial, workers=WorkerOptions(1)), ("forward",), (0, 1, 2), ("apartment",))
    with pytest.raises(Stopped):
        list(run_sweep(sweep, InterruptedOperators()))
    assert len(sessions) == 1
