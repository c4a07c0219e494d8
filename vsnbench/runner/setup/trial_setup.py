"""Trial setup: a robot and a model that are ready for trials, and the description of both.

The driver process and every worker build their setup from the same `TrialSetupSpec`. Equal specs give equal
descriptions and equal results.
"""

import logging
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from os import _exit as end_process_now
from typing import Any

from vsnbench.errors import ExitCode, UsageError
from vsnbench.models.checkpoints.torch_runtime import DEVICES
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.fit.camera import CroppedPolicy, Fit, crop_condition, crop_for, difference_text
from vsnbench.models.human.controls import Controls
from vsnbench.models.human.policy import Human
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.loaded import LoadedPolicy
from vsnbench.models.names import is_stack, is_third_party
from vsnbench.models.process_exit import process_exit_refused, take_refused_exit
from vsnbench.models.registry import create_policy, keywords_of, locate
from vsnbench.models.remote.isolation import IsolatedPolicy, Isolation
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.stack.policy import StackPolicy
from vsnbench.models.step_sizes import wrong_assumptions
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import KeepFiles
from vsnbench.results.writing.campaigns import model_sha256
from vsnbench.results.writing.provenance import Provenance, gather_provenance
from vsnbench.robots.contract import Robot
from vsnbench.robots.registry import identity_of, is_simulated, open_robot
from vsnbench.runner.disturbances.fit import check_disturbances
from vsnbench.runner.setup.execution import check_execution, check_sequences
from vsnbench.runner.setup.selection import choose_goals
from vsnbench.runtime.floating_point import floating_point_restored
from vsnbench.runtime.threads import COMPUTE_THREADS, compute_with_one_thread
from vsnbench.runtime.time_limits import call_interrupted
from vsnbench.sites.site import Site
from vsnbench.text.sanitize import error_line
from vsnbench.values.camera import Camera, CameraRole
from vsnbench.values.movement import ActionKind
from vsnbench.values.observation import Sensor
from vsnbench.values.robot_identity import RobotIdentity

logger = logging.getLogger(__name__)

CLOSE_TIMEOUT_S = 30.0
"""Seconds that a model's `close` may take before it is interrupted."""
CLOSE_GRACE_S = 5.0
"""Seconds after the interruption until the process is ended."""


@dataclass(frozen=True, slots=True)
class TrialSetupSpec:
    """Serializable description of a robot and a model, sent to worker processes."""

    site: Site
    model: str
    goals: tuple[str, ...]
    """Names of the site's goals, or `all`."""
    robot: str = "simulated"
    noise: bool = False
    rehearsal: bool = False
    """A rehearsal: a simulated robot is treated as a real one, which a person places."""
    disturbances: Disturbances = NONE
    """Of what the model sees."""
    parameters: ProtocolParameters = field(default_factory=ProtocolParameters)
    model_options: Mapping[str, Any] = field(default_factory=dict)
    device: str | None = None
    """Device for a model that has one and no other in its options; None for the model's default."""
    act_timeout_s: float | None = None
    """Time limit for an action; None for no limit, or the connection's for a model in another process."""
    isolation: Isolation | None = None
    """Runs the model in a separate process."""
    fit: Fit = Fit.FULL
    """Images that the model receives."""
    keep: KeepFiles = KeepFiles.ALL
    """What is stored of the episodes; results do not depend on it."""

    def for_elsewhere(self, card: ModelCard) -> "TrialSetupSpec":
        """Return the spec for other machines, with the runtime and device that the model chose by measuring here."""
        chosen = {
            name: card.runs_on[name]
            for name in ("runtime", "device")
            if name in card.runs_on and self.model_takes(name) and (name == "runtime" or card.runs_on[name] in DEVICES)
        }
        return replace(self, model_options={**self.options, **chosen}) if chosen else self

    @property
    def options(self) -> Mapping[str, Any]:
        """Arguments of the model's constructor, with the device."""
        if self.device is None or not self._has_device:
            return self.model_options
        return {"device": self.device, **self.model_options}

    @property
    def _has_device(self) -> bool:
        """Whether the model has a device. Of isolated models, only the package's own are known here."""
        if self.isolation is None:
            return self.model_takes("device")
        own = self.isolation.python is None and not is_third_party(self.model)
        return own and "device" in keywords_of(locate(self.model)[1])

    def model_takes(self, option: str) -> bool:
        """Return whether the model has an option of that name; False for one in a separate process."""
        return self.isolation is None and option in keywords_of(locate(self.model)[1])


@dataclass(frozen=True, slots=True)
class SetupDescription:
    """Everything that results depend on, except the trial."""

    robot: RobotIdentity
    sensors: frozenset[Sensor]
    conditions: Mapping[str, Any]
    card: ModelCard
    """The model's card as the record has it: see `ModelCard.recorded`."""
    goals: tuple[str, ...]
    """Requested categories that the site has and the model knows."""
    needs_operator: bool = False
    seen_camera: Camera | None = None
    """Camera of the images that the model receives; None if unknown."""
    sessions: int | None = None
    """Number of clients that the model's server takes; None for a model that every worker has for itself."""

    @property
    def title(self) -> str:
        """Name of the model and its weights, for people."""
        return f"{self.card.name} ({self.card.weights_label})" if self.card.weights_label else self.card.name

    @property
    def on_gpu(self) -> bool:
        """Whether the model reports that it runs on a GPU."""
        return self.card.runs_on.get("device", "cpu") != "cpu"

    def difference(self, other: "SetupDescription") -> str:
        """Return how another setup with the same spec differs; empty if it does not."""
        pairs = {
            "robot": (self.robot.sha256, other.robot.sha256),
            "model": (model_sha256(self.card), model_sha256(other.card)),
            "conditions": (dict(self.conditions), dict(other.conditions)),
        }
        return ", ".join(f"{name} {ours} and {theirs}" for name, (ours, theirs) in pairs.items() if ours != theirs)


@dataclass(frozen=True, slots=True)
class TrialSetup:
    """A robot and a model, ready for trials."""

    robot: Robot
    policy: Policy
    description: SetupDescription
    controls: Controls | None = None
    """Those of the person who drives; None for a model."""

    def provenance(self, command: str | None = None) -> Provenance:
        """Describe this process and the device that the model uses; a worker gives the driver's command line."""
        here = gather_provenance(of_run=True)
        runs_on = {f"model_{name}": str(value) for name, value in self.policy.card.runs_on.items()}
        threads = {"compute_threads": str(COMPUTE_THREADS)} if self.description.robot.simulated else {}
        return replace(
            here, command=here.command if command is None else command, platform={**here.platform, **threads, **runs_on}
        )


@contextmanager
def open_trial_setup(spec: TrialSetupSpec) -> Iterator[TrialSetup]:
    """Make the robot and the model of a spec, check that they fit together, and close both at the end.

    Raises:
        UsageError: something named does not exist or does not fit together.
        VsnbenchError: the model or the robot cannot be used.
    """
    use_one_thread_in_simulation(spec.robot)
    with process_exit_refused(), floating_point_restored():
        policy = load_policy(spec)
        try:
            spec = replace(spec, goals=choose_goals(spec.goals, spec.site, policy.card))
            used = policy.card.sensors | (frozenset() if spec.keep is KeepFiles.NONE else {Sensor.RGB})
            how = {"noise": spec.noise, "rehearsal": spec.rehearsal}
            with open_robot(spec.robot, spec.site, spec.parameters, **how, read=used) as robot:
                yield prepare_setup(spec, policy, robot)
        finally:
            close_policy(policy)


def load_policy(spec: TrialSetupSpec) -> LoadedPolicy:
    """Make the model of a spec.

    Raises:
        UsageError: the model or one of its options does not exist.
        ModelError: the model cannot be made.
    """
    policy = create_policy(spec.model, spec.isolation, **spec.options)
    if is_stack(spec.model):
        return LoadedPolicy(policy, remote=True)
    if not isinstance(policy, RemotePolicy | Human):
        return LoadedPolicy(policy, spec.act_timeout_s)
    if spec.act_timeout_s is not None:
        policy.limit_actions(spec.act_timeout_s)
    return LoadedPolicy(policy, remote=True)


def use_one_thread_in_simulation(robot: str) -> None:
    """Limit computation to one thread in simulation, which makes results independent of the machine."""
    if is_simulated(robot):
        compute_with_one_thread()


def prepare_setup(spec: TrialSetupSpec, policy: LoadedPolicy, robot: Robot) -> TrialSetup:
    """Combine a policy and a robot, and check that they fit together. The spec's goals are those of `choose_goals`.

    Raises:
        UsageError: the robot lacks a sensor, or its images cannot be cropped.
    """
    identity = identity_of(robot)
    camera = identity.profile.camera.without_roll
    crop = crop_for(policy.card, identity.profile.name, camera) if spec.fit is Fit.CROP else None
    model = policy.policy
    sessions = model.sessions if isinstance(model, RemotePolicy) and not isinstance(model, IsolatedPolicy) else None
    description = SetupDescription(
        robot=identity,
        sensors=robot.sensors,
        conditions={
            **robot.conditions,
            **spec.disturbances.conditions,
            **({} if crop is None else crop_condition(crop)),
        },
        card=policy.card.recorded(files_handed_over(spec.model, policy.policy, spec.options), code_of(policy.policy)),
        goals=spec.goals,
        needs_operator=robot.needs_operator,
        seen_camera=crop or camera,
        sessions=sessions,
    )
    _check_sensors(description, robot.cameras)
    _check_action_kinds(description, robot.action_kinds)
    _check_weights(description)
    check_disturbances(spec.disturbances, robot)
    check_execution(spec.parameters, spec.disturbances, robot, description.card)
    check_sequences(spec.site, spec.goals, spec.parameters)
    if isinstance(model, StackPolicy):
        model.join(robot.exchange)
    seen = policy if crop is None else CroppedPolicy(policy, camera, crop)
    return TrialSetup(robot, seen, description, model.controls if isinstance(model, Human) else None)


def close_policy(policy: Policy) -> None:
    """Close a policy within `CLOSE_TIMEOUT_S`, and log its errors.

    If the policy cannot be interrupted, the process ends. Every finished step is recorded by then.
    """
    last_resort = threading.Timer(CLOSE_TIMEOUT_S + CLOSE_GRACE_S, _end_with_stuck_model)
    last_resort.daemon = True
    last_resort.start()
    try:
        call_interrupted(policy.close, CLOSE_TIMEOUT_S)
    except BaseException as error:
        logger.warning("model %s failed in close: %s", policy.card.name, take_refused_exit() or error_line(error))
    finally:
        last_resort.cancel()


def _end_with_stuck_model() -> None:
    text = (
        b"vsnbench: error: a model does not return from close; the process ends, and every finished step is recorded\n"
    )
    os.write(2, text)
    end_process_now(ExitCode.FAILED)


def _check_sensors(description: SetupDescription, cameras: frozenset[CameraRole]) -> None:
    card, robot = description.card, description.robot.profile.name
    if missing := card.sensors - description.sensors:
        labels = "only the simulator labels instances: give the model a real detector's weights"
        raise UsageError(
            f"model {card.name} needs {', '.join(sorted(missing))}, which robot {robot} does not have; "
            f"it has {', '.join(sorted(description.sensors))}",
            advice=labels if Sensor.INSTANCES in missing else "",
            code="missing-sensor",
        )
    if further := card.cameras - cameras:
        raise UsageError(
            f"model {card.name} needs a {' and a '.join(sorted(further))} camera, which robot {robot} does not have",
            advice="list its further cameras in the profile: docs/robots.md",
            code="missing-camera",
        )


def _check_action_kinds(description: SetupDescription, executed: frozenset[ActionKind]) -> None:
    """Check that the robot executes what the model answers with. The runner unrolls chunks and resolves pixels."""
    card, robot = description.card, description.robot.profile.name
    needed = card.action_kinds - {ActionKind.CHUNK}
    if ActionKind.PIXEL in needed:
        needed = needed - {ActionKind.PIXEL} | {ActionKind.WAYPOINT}
        if Sensor.DEPTH not in description.sensors:
            raise UsageError(
                f"model {card.name} answers with pixels, and robot {robot} has no depth camera to resolve them",
                advice="use a robot with depth, or a model that answers with waypoints",
                code="unsupported-action-kind",
            )
    if missing := needed - executed:
        raise UsageError(
            f"model {card.name} answers with {', '.join(sorted(missing))}, which robot {robot} cannot execute; "
            f"it executes {', '.join(sorted(executed))}",
            advice="drive the base with `vsnbench robots serve`, or use --robot simulated"
            if executed == frozenset({ActionKind.DISCRETE})
            else "a base that can move sideways states base.max_lateral_m_s in its profile"
            if ActionKind.SIDESTEP in missing
            else "use a robot that executes it",
            code="unsupported-action-kind",
        )


def _check_weights(description: SetupDescription) -> None:
    card = description.card
    if card.stand_in and not description.robot.simulated:
        raise UsageError(
            f"model {card.name}: robot {description.robot.profile.name} is real, and no weights were given for it, "
            f"only the {card.weights_label}",
            advice="give your weights with --weights FILE, or accept these with --weights embedded",
            code="no-weights",
        )


def warn_of_assumptions(card: ModelCard, parameters: ProtocolParameters) -> None:
    """Log a warning for each step size that a model assumes and the protocol does not have."""
    for difference in wrong_assumptions(card, parameters):
        logger.warning("%s", difference)


def warn_of_camera(description: SetupDescription) -> None:
    """Log a warning where the camera is not the one that the model was trained with."""
    camera = description.seen_camera or description.robot.profile.camera
    if text := difference_text(description.card, description.robot.profile.name, camera):
        logger.warning("%s", text)


def warn_of_default_weights(description: SetupDescription) -> None:
    """Log a warning where no weights were given."""
    if description.card.stand_in:
        card = description.card
        logger.warning("%s runs on %s; give others with --weights FILE", card.name, card.weights_label)
