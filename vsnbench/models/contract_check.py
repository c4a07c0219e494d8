"""Tries a policy against the contract of docs/models.md: for people who write one."""

import statistics
import sysconfig
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsnbench.errors import ModelError, ModelLostError, SensorNotDeclaredError, VsnbenchError
from vsnbench.harmless_text import error_line, harmless
from vsnbench.models.contract import Policy
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.decision_check import checked_decision
from vsnbench.protocol.observation import InstanceImage, Observation, shown_to_policy
from vsnbench.protocol.pose import Pose

STEPS = 20
SEED = 11
SIZES = ((640, 480), (640, 360), (33, 17))
_NO_GOAL = "no such goal"
_NOT_THE_MODEL = (Path(__file__).parents[1], *(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib")))


@dataclass(frozen=True, slots=True)
class ContractFinding:
    """One thing that was tried."""

    what: str
    passed: bool
    seen: str


def try_each(trials: Mapping[str, Callable[[], str]]) -> list[ContractFinding]:
    """Carry out every trial, each by what it says it saw, or by the error that it raised."""
    findings = []
    for what, trial in trials.items():
        try:
            findings.append(ContractFinding(what, True, trial()))
        except VsnbenchError as error:
            findings.append(ContractFinding(what, False, str(error)))
        except (Exception, SystemExit) as error:  # a third party's code: anything can happen
            findings.append(ContractFinding(what, False, _line_and_place(error)))
    return findings


def check_policy(policy: Policy) -> tuple[ContractFinding, ...]:
    """Try everything that the contract asks of a policy, each with what was seen; takes some 200 of its steps."""
    goal = known_goal(policy)
    return tuple(
        try_each(
            {
                "card": lambda: card_in_words(policy),
                "reset, twice": lambda: reset_twice(policy, goal),
                "one seed, one answer": lambda: repeats(policy, goal, deterministic=True),
                "an episode forgets the last": lambda: _forgets(policy, goal),
                "sensors on the card are read": lambda: _reads_its_sensors(policy, goal),
                "a goal that it does not know": lambda: unknown_goal(policy, goal),
                "other image sizes": lambda: sizes(policy, goal),
                "black image, no depth anywhere": lambda: _blind(policy, goal),
                "time": lambda: _time(policy, goal),
            }
        )
    )


def known_goal(policy: Policy) -> str:
    """Return a goal that the policy says it knows."""
    return min(policy.card.goals & set(GOAL_CATEGORIES) or policy.card.goals) if policy.card.goals else "chair"


def card_in_words(policy: Policy) -> str:
    """Return name, sensors and goals of a policy."""
    card = policy.card
    sensors = ", ".join(sorted(sensor.value for sensor in card.sensors)) or "no sensors"
    return f"{card.name}; {sensors}; {'any goal' if card.goals is None else ', '.join(sorted(card.goals))}"


def look(policy: Policy, number: int, width: int = 640, height: int = 480, *, blind: bool = False) -> Observation:
    """Return what a policy is shown of a made-up look: noise, the same for the same number."""
    return shown_to_policy(_everything(number, width, height, blind=blind), policy.card.sensors)


def reset_twice(policy: Policy, goal: str) -> str:
    """Begin an episode, and begin another one before the first has seen anything."""
    policy.reset(goal, SEED)
    policy.reset(goal, SEED)
    return f"{goal}, seed {SEED}"


def repeats(policy: Policy, goal: str, *, deterministic: bool) -> str:
    """Show the same looks under the same seed twice.

    Raises:
        ModelError: the actions differ, and the policy is said to be deterministic.
    """
    first, again = (episode(policy, goal, SEED) for _ in range(2))
    number = _first_difference(first, again)
    if number and deterministic:
        raise ModelError(
            f"action {number} differs on the same seed and images",
            advice="draw every random number from the seed of `reset`, or say `deterministic: False` on a served "
            "model's card",
        )
    return f"{STEPS} actions, {'as the card says, not repeated' if number else 'the same twice'}"


def unknown_goal(policy: Policy, goal: str) -> str:
    """Ask for a goal that does not exist.

    Raises:
        ModelError: it is taken, though the card names the goals.
    """
    try:
        policy.reset(_NO_GOAL, SEED)
    except ModelLostError:
        raise
    except Exception as error:  # whatever a third party refuses with
        policy.reset(goal, SEED)
        return f"refused: {_line(error)}"
    if policy.card.goals is None:
        return "taken, as the card says: any goal"
    raise ModelError("taken, and the card names the goals that it knows", advice="raise an error in `reset`")


def sizes(policy: Policy, goal: str) -> str:
    """Show images of other cameras.

    Raises:
        ModelError: one was not taken.
    """
    for width, height in SIZES:
        policy.reset(goal, SEED)
        try:
            _act(policy, look(policy, 1, width, height))
        except ModelLostError:
            raise
        except Exception as error:
            raise ModelError(f"{width} x {height}: {_line_and_place(error)}") from error
    return ", ".join(f"{width} x {height}" for width, height in SIZES)


def episode(policy: Policy, goal: str, seed: int, steps: int = STEPS) -> list[Decision]:
    """Return what a policy decides in one made-up episode, whatever it says of STOP."""
    policy.reset(goal, seed)
    return [_act(policy, look(policy, number)) for number in range(steps)]


def _act(policy: Policy, observation: Observation) -> Decision:
    """Return a decision, checked as in a run."""
    return checked_decision(policy.act(observation))


def _forgets(policy: Policy, goal: str) -> str:
    first = episode(policy, goal, SEED)
    episode(policy, goal, SEED + 1, 7)
    if number := _first_difference(first, episode(policy, goal, SEED)):
        raise ModelError(
            f"action {number} differs after another episode", advice="set everything anew in `reset`: nothing is kept"
        )
    return "the same actions after another episode"


def _reads_its_sensors(policy: Policy, goal: str) -> str:
    unread = []
    for sensor in sorted(policy.card.sensors):
        policy.reset(goal, SEED)
        try:
            for number in range(STEPS):
                policy.act(shown_to_policy(_everything(number), policy.card.sensors - {sensor}))
        except SensorNotDeclaredError:
            continue
        except Exception as error:  # it was missed, and the policy says so in words of its own
            if _caused_by_sensor(error):
                continue
            raise
        unread.append(sensor.value)
    if unread:
        # It may need them elsewhere: no fault, and worth a look.
        return f"{' and '.join(unread)} on the card, and not read in {STEPS} steps: needed?"
    return ", ".join(sorted(policy.card.sensors)) or "it needs none"


def _caused_by_sensor(error: BaseException) -> bool:
    """Whether an error came of a sensor that was not shown; a third party's chain of causes may be a ring."""
    cause: BaseException | None = error
    met: set[int] = set()
    while cause is not None and id(cause) not in met:
        if isinstance(cause, SensorNotDeclaredError):
            return True
        met.add(id(cause))
        cause = cause.__cause__ or cause.__context__
    return False


def _blind(policy: Policy, goal: str) -> str:
    policy.reset(goal, SEED)
    return f"{_act(policy, look(policy, 0, blind=True)).action.value}"


def _time(policy: Policy, goal: str) -> str:
    policy.reset(goal, SEED)
    took_s = []
    for number in range(STEPS):
        seen = look(policy, number)
        began_s = time.perf_counter()
        policy.act(seen)
        took_s.append(time.perf_counter() - began_s)
    return f"{statistics.median(took_s) * 1000:.1f} ms a step at the median, {max(took_s) * 1000:.1f} at most"


def _first_difference(first: list[Decision], again: list[Decision]) -> int:
    """Return the number of the first action that differs, from 1; 0 when none does."""
    return next((number for number, (a, b) in enumerate(zip(first, again, strict=True), 1) if a.action != b.action), 0)


def _line(error: BaseException) -> str:
    return str(error) if isinstance(error, VsnbenchError) else error_line(error)


def _line_and_place(error: BaseException) -> str:
    """Return what a model raised, and the last line of its own code on the way there."""
    own = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<") and not any(map(Path(frame.filename).is_relative_to, _NOT_THE_MODEL))
    ]
    if not own or isinstance(error, VsnbenchError):
        return _line(error)
    return f"{_line(error)} ({harmless(Path(own[-1].filename).name)}, line {own[-1].lineno})"


def _everything(number: int, width: int = 640, height: int = 480, *, blind: bool = False) -> Observation:
    rng = np.random.default_rng(number)
    rgb = rng.integers(0, 256, (height, width, 3), np.uint8)
    depth_m = rng.uniform(0.4, 8.0, (height, width)).astype(np.float32)
    depth_m[:, : width // 8] = np.nan
    if blind:
        rgb[:], depth_m[:] = 0, np.nan
    camera = Camera(width=width, height=height, horizontal_fov_deg=60, mount_height_m=0.6)
    labels = InstanceImage((rng.integers(0, 3, (height, width))).astype(np.int32), {1: "chair", 2: "bed"})
    pose = Pose(0.25 * number, 0.0, 0.1 * number)
    return Observation(rgb, depth_m, pose, float(number), camera, instances=labels)
