"""The bench that trials are run on: one robot and one model, made once, and what they say of themselves.

Whoever runs trials, this process or a worker elsewhere, makes its bench from the same `BenchPlan`; equal plans give
benches with equal descriptions, and every trial on them comes out the same.
"""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from vsnbench.compute_threads import COMPUTE_THREADS, compute_with_one_thread
from vsnbench.database.campaign_plan import ModelIdentity
from vsnbench.database.provenance import Provenance, gather_provenance
from vsnbench.errors import UsageError
from vsnbench.harmless_text import error_line
from vsnbench.models.contract import ModelCard, Policy, SurveyedPolicy
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.registry import create_policy, keywords_of, locate
from vsnbench.models.remote.isolation import Isolation
from vsnbench.models.timed import timed
from vsnbench.models.torch_runtime import DEVICES
from vsnbench.protocol.observation import Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import Site
from vsnbench.record.results import Kept
from vsnbench.robots.contract import PlacedByHand, Robot
from vsnbench.robots.registry import identity_of, is_simulated, open_robot
from vsnbench.runner.selection import choose_goals

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class BenchPlan:
    """What a bench is made from: plain values, so that any process can be told."""

    site: Site
    model: str
    goals: tuple[str, ...]
    """As they were asked for."""
    robot: str = "simulated"
    noise: bool = False
    pretend_real: bool = False
    """A simulated robot plays a real one, which a person places."""
    parameters: ProtocolParameters = field(default_factory=ProtocolParameters)
    model_options: Mapping[str, Any] = field(default_factory=dict)
    act_timeout_s: float | None = None
    """How long a model in the bench's process may take for an action; without end when None."""
    isolation: Isolation | None = None
    """Run the model in a process of its own."""
    kept: Kept = Kept.FULL
    """What is kept of the episodes that are run on it; no result depends on it."""

    def for_elsewhere(self, card: ModelCard) -> "BenchPlan":
        """Return the plan for other machines: what a model has chosen by measuring where it made `card` holds there."""
        chosen = {
            name: card.runs_on[name]
            for name in ("runtime", "device")
            if name in card.runs_on and self.model_takes(name) and (name == "runtime" or card.runs_on[name] in DEVICES)
        }
        return replace(self, model_options={**self.model_options, **chosen}) if chosen else self

    def model_takes(self, option: str) -> bool:
        """Return whether the model, where it runs in the bench's own process, has an option of that name."""
        return self.isolation is None and option in keywords_of(locate(self.model)[1])


@dataclass(frozen=True, slots=True)
class BenchDescription:
    """What a bench says of itself: all that results on it depend on, but for the trial."""

    robot: RobotIdentity
    sensors: frozenset[Sensor]
    conditions: Mapping[str, Any]
    card: ModelCard
    model: ModelIdentity
    goals: tuple[str, ...]
    """What was asked for, as categories that the site has and the model knows."""
    needs_a_person: bool = False

    @property
    def title(self) -> str:
        """The model's name for people, with its weights where it has any."""
        return f"{self.card.name} ({self.card.weights_label})" if self.card.weights_label else self.card.name

    @property
    def on_gpu(self) -> bool:
        """Whether the model says that it runs on one."""
        return self.card.runs_on.get("device", "cpu") != "cpu"

    def difference(self, other: "BenchDescription") -> str:
        """Say in words what is not the same on another bench made from the same plan; empty when all is."""
        pairs = {
            "robot": (self.robot.sha256, other.robot.sha256),
            "model": (self.model.sha256, other.model.sha256),
            "conditions": (dict(self.conditions), dict(other.conditions)),
        }
        return ", ".join(f"{name} {ours} and {theirs}" for name, (ours, theirs) in pairs.items() if ours != theirs)


@dataclass(frozen=True, slots=True)
class Bench:
    """A robot and a model, ready for trials."""

    robot: Robot
    policy: Policy
    description: BenchDescription

    def provenance(self, command: str | None = None) -> Provenance:
        """Describe this process, and where in it the model runs.

        Args:
            command: what was typed, where that was another process's command line.
        """
        here = gather_provenance()
        runs_on = {f"model_{name}": str(value) for name, value in self.policy.card.runs_on.items()}
        threads = {"compute_threads": str(COMPUTE_THREADS)} if self.description.robot.simulated else {}
        return replace(
            here, command=here.command if command is None else command, platform={**here.platform, **threads, **runs_on}
        )


@contextmanager
def open_bench(plan: BenchPlan) -> Iterator[Bench]:
    """Make the robot and the model of a plan, see that they fit together, and close both afterwards.

    Raises:
        UsageError: something named does not exist or does not fit together.
        VsnbenchError: the model or the robot cannot be used.
    """
    settle_threads(plan.robot)
    policy = create_policy(plan.model, plan.isolation, **plan.model_options)
    try:
        choose_goals(plan.goals, plan.site, policy.card)
        # An image that is kept is looked at too.
        read = policy.card.sensors | (frozenset() if plan.kept is Kept.NUMBERS else {Sensor.RGB})
        with open_robot(
            plan.robot,
            plan.site,
            plan.parameters,
            noise=plan.noise,
            pretend_real=plan.pretend_real,
            read=read,
        ) as robot:
            yield on_bench(plan, policy, robot)
    finally:
        close_policy(policy)


def settle_threads(robot: str) -> None:
    """Compute in simulation with one thread, wherever a trial is run: then it comes out the same."""
    if is_simulated(robot):
        compute_with_one_thread()


def on_bench(plan: BenchPlan, policy: Policy, robot: Robot) -> Bench:
    """Put a policy and a robot together and see that they fit.

    Raises:
        UsageError: the model does not know a goal, or the robot lacks what it needs.
    """
    description = BenchDescription(
        robot=identity_of(robot),
        sensors=robot.sensors,
        conditions=dict(robot.conditions),
        card=policy.card,
        model=_identity(plan, policy),
        goals=choose_goals(plan.goals, plan.site, policy.card),
        needs_a_person=isinstance(robot, PlacedByHand) and robot.needs_a_person,
    )
    _check_sensors(description)
    _check_weights(description)
    limited = policy if plan.act_timeout_s is None else timed(policy, plan.act_timeout_s)
    return Bench(robot, limited, description)


def close_policy(policy: Policy) -> None:
    """Let the policy go; what it raises then changes no result."""
    try:
        getattr(policy, "close", lambda: None)()
    except Exception as error:
        logger.warning("model %s failed in close: %s", policy.card.name, error_line(error))


def _identity(plan: BenchPlan, policy: Policy) -> ModelIdentity:
    card = policy.card
    return ModelIdentity(
        name=card.name,
        goals=card.goals,
        sensors=frozenset(sensor.value for sensor in card.sensors),
        weights_sha256=card.weights_sha256,
        weights_label=card.weights_label,
        settings=card.settings,
        surveyed=isinstance(policy, SurveyedPolicy),
        files=files_handed_over(plan.model, policy, plan.model_options),
        code=code_of(policy),
    )


def _check_sensors(described: BenchDescription) -> None:
    card, who = described.card, described.robot.profile.name
    missing = card.sensors - described.sensors
    if missing:
        labels = Sensor.INSTANCES in missing
        raise UsageError(
            f"model {card.name} needs {', '.join(sorted(missing))}, which robot {who} does not "
            f"have; it has {', '.join(sorted(described.sensors))}"
            + ("; instances are the simulator's own labels: give the model a real detector's weights" if labels else "")
        )


def _check_weights(described: BenchDescription) -> None:
    card = described.card
    if card.stand_in and not described.robot.simulated:
        raise UsageError(
            f"model {card.name}: robot {described.robot.profile.name} is real, and nothing was named to drive "
            f"it but the {card.weights_label}",
            advice="name your weights with --weights FILE, or these with --weights embedded",
        )


def tell_of_stand_in(described: BenchDescription) -> None:
    """Say that nobody named the model's weights, where that is so."""
    if described.card.stand_in:
        logger.warning(
            "%s runs on %s; name others with --weights FILE", described.card.name, described.card.weights_label
        )
