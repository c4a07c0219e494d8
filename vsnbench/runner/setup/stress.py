"""A stress test: every campaign of a sweep undisturbed, and with each disturbance at each severity."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace

from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.protocol.disturbances import (
    NONE,
    SEVERITIES,
    STANDARD_SET,
    STRESS_KINDS,
    Disturbance,
    Disturbances,
    known_kind,
)
from vsnbench.protocol.execution import CONTINUOUS, Execution
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.report.wording import listed
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.setup.selection import max_goals
from vsnbench.runner.setup.sweep import Sweep
from vsnbench.runner.setup.trial_setup import TrialSetupSpec, close_policy, load_policy
from vsnbench.statistics.power import Design, detectable, least_p, min_starts, power, starts_needed, trials_needed
from vsnbench.statistics.rates import POWER
from vsnbench.study.power import ASSUMED
from vsnbench.text.sanitize import counted
from vsnbench.values.observation import Sensor

logger = logging.getLogger(__name__)

ALPHA = 0.05
"""Largest corrected p-value that shows a loss."""
DEFAULT_SEVERITIES = (1, 3, 5)


def check_robot(robot: str) -> None:
    """Refuse a real robot, which would have to repeat every trial with every disturbance.

    Raises:
        UsageError: the robot is not simulated in this process (`real-robot`).
    """
    if not is_simulated(robot):
        raise UsageError(
            f"a stress test needs a simulated robot, and {robot} is real",
            advice="measure single conditions with `vsnbench run --disturb`",
            code="real-robot",
        )


def seen_by(sweep: Sweep) -> dict[str, frozenset[Sensor]]:
    """Return the sensors that each model of a sweep uses, which needs its weights; models that fail are left out."""
    sensors: dict[str, frozenset[Sensor]] = {}
    for model, setup in {request.setup.model: request.setup for request in reversed(sweep)}.items():
        try:
            policy = load_policy(setup)
        except VsnbenchError as error:  # its campaigns report why
            logger.debug("%s cannot be loaded: %s", model, error)
            continue
        sensors[model] = policy.card.sensors
        close_policy(policy)
    return sensors


def unseen_by(
    sensors: Mapping[str, frozenset[Sensor]], conditions: Sequence[Disturbances]
) -> dict[str, tuple[str, ...]]:
    """Return the disturbances that change nothing that a model uses, by model.

    Raises:
        UsageError: no model uses what any of them changes (`unseen-disturbance`).
    """
    unseen = {
        model: tuple(dict.fromkeys(name for condition in conditions for name in condition.unused_by(used)))
        for model, used in sensors.items()
    }
    names = {member.name for condition in conditions for member in condition.members}
    if unseen and all(names == set(own) for own in unseen.values()):
        raise UsageError(
            f"--disturb: {listed(unseen)} uses no sensor that {listed(sorted(names))} changes",
            advice="`vsnbench models show MODEL` lists the sensors of a model",
            code="unseen-disturbance",
        )
    return unseen


def under_conditions(sweep: Sweep, conditions: Sequence[Disturbances], unseen: Mapping[str, Sequence[str]]) -> Sweep:
    """Return a sweep with every campaign under every condition, in their order.

    Args:
        sweep: campaigns without disturbances.
        conditions: undisturbed, and single disturbances.
        unseen: disturbances that are left out, by model.
    """
    return tuple(
        replace(request, setup=_under(request.setup, condition))
        for request in sweep
        for condition in conditions
        if not any(member.name in unseen.get(request.setup.model, ()) for member in condition.members)
    )


def _under(setup: TrialSetupSpec, condition: Disturbances) -> TrialSetupSpec:
    latency_s = condition[CONTINUOUS]
    if latency_s is None:
        return replace(setup, disturbances=condition)
    return replace(setup, parameters=setup.parameters.executed(Execution(latency_s=latency_s)))


def condition_of(setup: TrialSetupSpec, undisturbed: ProtocolParameters) -> Disturbances:
    """Return the condition of a stress test that a setup has.

    Args:
        setup: setup of a campaign under a condition.
        undisturbed: protocol of the undisturbed campaign.
    """
    execution = setup.parameters.execution
    if execution is None or execution.latency_s is None or setup.parameters == undisturbed:
        return setup.disturbances
    return Disturbances((Disturbance(CONTINUOUS, execution.latency_s),))


def design_of_stress(sweep: Sweep) -> Design:
    """Return the weakest paired design among the models and sites of a stress test, at Holm's strictest step.

    Args:
        sweep: campaigns under every condition.
    """
    repetitions = sweep[0].repetitions
    conditions: dict[tuple[str, str], set[Disturbances]] = {}
    for request in sweep:
        own = conditions.setdefault((request.setup.model, request.site_name), set())
        own |= {condition_of(request.setup, sweep[0].setup.parameters)} - {NONE}
    return Design(
        starts=min(len(request.start_numbers) for request in sweep),
        cells=max(1, min(max_goals(request.setup.goals, request.setup.site) for request in sweep)),
        trials=repetitions * len({request.seed for request in sweep}),
        rate=0.5,
        resemblance=ASSUMED,
        level=ALPHA / max(1, *(len(own) for own in conditions.values())),
    )


def weakness_of(design: Design) -> str:
    """Return why a stress test can show no loss whatever its results are; empty if it can."""
    least = least_p(design.starts)
    if least <= design.level:
        return ""
    conditions = round(ALPHA / design.level)
    return (
        f"this stress test can show no loss: with {counted(design.starts, 'starting position')} the smallest possible "
        f"p-value is {least:.2g}, after correction for {counted(conditions, 'condition')} "
        f"{min(1.0, least * conditions):.2g}; use at least {min_starts(design.level)} positions, or fewer disturbances "
        "and severities"
    )


def power_line(design: Design) -> str:
    """Return the smallest loss that a stress test shows with 80 % power, in a sentence."""
    points = detectable(design)
    shown = "no loss" if points is None else f"a loss of {100 * points:.0f} points or more"
    return f"this stress test shows {shown} with 80 % power; {_size(design)}"


def check_detects(design: Design, loss: float) -> None:
    """Refuse a stress test with less than 80 % power for a loss.

    Args:
        design: its design.
        loss: loss of success rate, 0 to 1.

    Raises:
        UsageError: its power is lower (`low-power`); the message names the starting positions and repetitions needed.
    """
    found = power(design, loss)
    if found >= POWER:
        return
    starts, trials = starts_needed(design, loss), trials_needed(design, loss)
    ways = [f"{starts} starting positions instead of {design.starts}"] if starts else []
    ways += (
        [f"{trials} trials per goal and position instead of {design.trials} (--repetitions, --seed)"] if trials else []
    )
    ways.append("fewer disturbances and severities")
    raise UsageError(
        f"--detect {100 * loss:.0f}: this stress test shows such a loss with {100 * found:.0f} % power, not 80 %; "
        f"{_size(design)}",
        advice=f"use {', or '.join(ways)}",
        code="low-power",
    )


def _size(design: Design) -> str:
    """Return the size of a design and what its power assumes."""
    return (
        f"{counted(design.starts, 'starting position')}, {counted(design.cells, 'goal')}, "
        f"{counted(design.trials, 'trial')} of each, {counted(round(ALPHA / design.level), 'condition')}; assumed: a "
        f"mean success rate of {100 * design.rate:.0f} %"
    )


def conditions_of(names: Sequence[str], severities: Sequence[int]) -> tuple[Disturbances, ...]:
    """Return the conditions of a stress test: undisturbed first, then each disturbance by severity.

    Args:
        names: names of disturbances; empty for the standard set.
        severities: from 1 to 5; empty for `DEFAULT_SEVERITIES`.

    Raises:
        UsageError: a name or a severity does not exist (`unknown-disturbance`, `invalid-severity`), or a name is given
            twice (`duplicate-disturbance`).
    """
    chosen: list[str] = []
    for name in names or STANDARD_SET:
        bare = name.strip().partition("=")[0].partition("@")[0]
        kind = known_kind(bare, STRESS_KINDS)
        if bare != name.strip():
            raise UsageError(
                f"--disturb {name}: a stress test takes names without values",
                advice=f"give --disturb {kind.name} --severity 1,3,5, or use `vsnbench run --disturb {name}`",
                code="invalid-disturbance",
            )
        if kind.name in chosen:
            raise UsageError(
                f"--disturb: {kind.name} is given twice", advice="give each name once", code="duplicate-disturbance"
            )
        chosen.append(kind.name)
    for severity in severities:
        if severity not in SEVERITIES:
            raise UsageError(
                f"--severity {severity}: severities are 1 to 5",
                advice="give numbers like 1,3,5",
                code="invalid-severity",
            )
    levels = sorted(set(severities or DEFAULT_SEVERITIES))
    return (NONE, *(Disturbances((STRESS_KINDS[name].at(level),)) for name in chosen for level in levels))
