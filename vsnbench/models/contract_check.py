"""Checks a policy against the contract in docs/models.md."""

import statistics
import sysconfig
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import EnumType
from pathlib import Path

from vsnbench.errors import ModelError, ModelLostError, SensorNotDeclaredError, VsnbenchError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.fit.camera import comparison_text
from vsnbench.models.fit.decision import fitting_decision
from vsnbench.models.fit.goal import word_for
from vsnbench.models.process_exit import take_refused_exit
from vsnbench.models.step_sizes import assumed_steps
from vsnbench.models.synthetic import every_sensor, synthetic_camera, synthetic_observation, synthetic_task
from vsnbench.models.task import Task
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.text.sanitize import error_line, sanitize
from vsnbench.text.suggestions import closest
from vsnbench.values.decision import Decision
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.observation import Observation
from vsnbench.values.robot_profile import RobotProfile

STEPS = 20
SEED = 11
SIZES = ((640, 480), (640, 360), (33, 17))
_UNKNOWN_GOAL = "no such goal"
_MOST_WORDS = 10
"""Words of a model's own vocabulary that are tried if none of them is a goal category."""
_NOT_THE_MODEL = (Path(__file__).parents[1], *(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib")))


@dataclass(frozen=True, slots=True)
class ContractFinding:
    """Result of one check."""

    what: str
    passed: bool
    seen: str


def try_each(checks: Mapping[str, Callable[[], str]]) -> Iterator[ContractFinding]:
    """Run every check and yield its result. Each check returns what it found, or raises an error."""
    for what, check in checks.items():
        try:
            seen = check()
            refused_exit = take_refused_exit()
            finding = ContractFinding(what, not refused_exit, refused_exit or seen)
        except VsnbenchError as error:
            finding = ContractFinding(what, False, str(error))
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # third-party code can raise anything
            finding = ContractFinding(what, False, take_refused_exit() or line_and_place(error))
        yield finding


def camera_findings(policy: Policy, profile: RobotProfile | None) -> tuple[ContractFinding, ...]:
    """Return the comparison of the trained camera with that of a robot. A difference is not a failure."""
    if profile is None:
        return ()
    return (ContractFinding("camera", True, comparison_text(policy.card, profile.name, profile.camera)),)


def check_policy(policy: Policy, profile: RobotProfile | None = None, steps: int = STEPS) -> Iterator[ContractFinding]:
    """Run every check of the contract, about ten episodes, and yield each result as it is known.

    Args:
        policy: the model.
        profile: the robot whose limits and camera count; None for a robot of common size.
        steps: steps of an episode, at least 2.
    """
    tasks = example_tasks(policy.card, profile)
    task = tasks[0]
    yield from try_each(
        {
            "card": lambda: card_summary(policy),
            "goals": lambda: goals(policy, tasks),
            "reset twice": lambda: reset_twice(policy, task),
            "same seed, same actions": lambda: repeats(policy, task, deterministic=True, steps=steps),
            "episodes are independent": lambda: _forgets(policy, task, steps),
            "sensors on the card": lambda: _reads_its_sensors(policy, task, steps),
            "unknown goal": lambda: unknown_goal(policy, task),
            "other image sizes": lambda: sizes(policy, task),
            "black image, no depth": lambda: _blind(policy, task),
            "time": lambda: _time(policy, task, steps),
        }
    )
    yield from camera_findings(policy, profile)


def example_tasks(card: ModelCard, profile: RobotProfile | None = None) -> list[Task]:
    """Return a task for each goal that a model takes: each category that it knows, and one of each other kind."""
    words = [word for word in (word_for(card, category) for category in GOAL_CATEGORIES) if word]
    categories = words or sorted(card.goals or ())[:_MOST_WORDS]
    accepted = [Goal(word) for word in categories if GoalKind.CATEGORY in card.goal_kinds]
    if GoalKind.TEXT in card.goal_kinds:
        accepted.append(Goal("example-text", GoalKind.TEXT, text="the red armchair by the window"))
    if GoalKind.INSTRUCTION in card.goal_kinds:
        route = "Turn left, walk past the sofa and stop in front of the table."
        accepted.append(Goal("example-route", GoalKind.INSTRUCTION, text=route))
    if GoalKind.IMAGE in card.goal_kinds:
        accepted.append(Goal("example-photo", GoalKind.IMAGE, image=every_sensor(SEED).rgb))
    if GoalKind.POINT in card.goal_kinds:
        accepted.append(Goal("example-point", GoalKind.POINT, point=(2.0, -0.5)))
    if GoalKind.ROUTE in card.goal_kinds:
        photographs = [every_sensor(SEED + number).rgb for number in range(3)]
        accepted.append(Goal("example-photographs", GoalKind.ROUTE, images=photographs))
    return [synthetic_task(goal, SEED, profile) for goal in accepted or [Goal("chair")]]


def card_summary(policy: Policy) -> str:
    """Return name, sensors, goals, kinds of answers and assumed step sizes of a policy."""
    card = policy.card
    sensors = ", ".join(sorted(sensor.value for sensor in card.sensors)) or "no sensors"
    known = "any category" if card.goals is None else ", ".join(sorted(card.goals))
    steps = assumed_steps(card)
    goal_kinds, answers = (", ".join(sorted(kinds)) for kinds in (card.goal_kinds, card.action_kinds))
    kinds = f"goals of kind {goal_kinds}; answers of kind {answers}"
    parts = (card.name, sensors, known if GoalKind.CATEGORY in card.goal_kinds else "", kinds)
    return "; ".join(filter(None, parts)) + (f"; assumes steps of {steps}" if steps else "")


def goals(policy: Policy, tasks: Sequence[Task]) -> str:
    """Start an episode for each goal that the card states, and take one step in it; then give them as a sequence.

    Raises:
        ModelError: the policy failed for one of them.
    """
    for task in tasks:
        try:
            episode(policy, task, steps=1)
        except ModelLostError:
            raise
        except Exception as error:
            kind = task.goal.kind if isinstance(task.goal, Goal) else GoalKind.CATEGORY
            raise ModelError(f"goal of kind {kind}, {str(task.goal)!r}: {line_and_place(error)}") from error
    if GoalKind.SEQUENCE in policy.card.goal_kinds:
        policy.begin(tasks[0])
        for number, task in enumerate(tasks[1:] or tasks):
            answer(policy, task, synthetic_observation(policy, number))
            policy.next_goal(task.goal)
    return ", ".join(str(task.goal) for task in tasks)


def reset_twice(policy: Policy, task: Task) -> str:
    """Start an episode, and start another before the first observation."""
    policy.begin(task)
    policy.begin(task)
    return f"{task.goal}, seed {task.seed}"


def repeats(policy: Policy, task: Task, *, deterministic: bool, steps: int = STEPS) -> str:
    """Run two episodes with the same observations and seed.

    Raises:
        ModelError: the decisions differ although the policy is deterministic.
    """
    first, again = (episode(policy, task, steps) for _ in range(2))
    number = first_difference(first, again)
    if number and deterministic:
        raise ModelError(
            f"action {number} differs for the same seed and images",
            advice="draw every random number from the seed of `reset`, or set `deterministic: False` on the card of a "
            "served model",
            code="not-repeatable",
        )
    return f"{steps} actions, {'not repeatable, as on the card' if number else 'the same twice'}"


def unknown_goal(policy: Policy, task: Task) -> str:
    """Begin an episode with a category that does not exist.

    Raises:
        ModelError: the policy accepts it although its card lists goals.
    """
    if GoalKind.CATEGORY not in policy.card.goal_kinds:
        return "not asked; the card takes no categories"
    try:
        policy.begin(replace(task, goal=Goal(_UNKNOWN_GOAL)))
    except ModelLostError:
        raise
    except Exception as error:  # any exception is a refusal
        policy.begin(task)
        return f"refused: {_line(error)}"
    if policy.card.goals is None:
        return "accepted; the card allows any goal"
    raise ModelError("accepted although the card lists goals", advice="raise an error in `reset`")


def sizes(policy: Policy, task: Task) -> str:
    """Run a step with robots whose cameras have other image sizes.

    Raises:
        ModelError: the policy failed at one size.
    """
    for width, height in SIZES:
        try:
            policy.begin(replace(task, robot=replace(task.robot, camera=synthetic_camera(width, height))))
            answer(policy, task, synthetic_observation(policy, 1, width, height))
        except ModelLostError:
            raise
        except Exception as error:
            raise ModelError(f"{width} x {height}: {line_and_place(error)}") from error
    return ", ".join(f"{width} x {height}" for width, height in SIZES)


def episode(policy: Policy, task: Task, steps: int = STEPS) -> list[Decision]:
    """Return the decisions of a policy in a synthetic episode, which continues after STOP."""
    policy.begin(task)
    return [answer(policy, task, synthetic_observation(policy, number)) for number in range(steps)]


def answer(policy: Policy, task: Task, observation: Observation) -> Decision:
    """Return a decision, validated as in a run."""
    return fitting_decision(policy.act(observation), policy.card, task.robot)


def _forgets(policy: Policy, task: Task, steps: int) -> str:
    first = episode(policy, task, steps)
    episode(policy, replace(task, seed=task.seed + 1), min(steps, 7))
    if number := first_difference(first, episode(policy, task, steps)):
        raise ModelError(f"action {number} differs after another episode", advice="reset all state in `reset`")
    return "the same actions after another episode"


def _reads_its_sensors(policy: Policy, task: Task, steps: int) -> str:
    unread = []
    for sensor in sorted(policy.card.sensors):
        policy.begin(task)
        try:
            for number in range(steps):
                card = replace(policy.card, sensors=policy.card.sensors - {sensor})
                policy.act(card.shown(every_sensor(number, roles=card.cameras)))
        except SensorNotDeclaredError:
            continue
        except Exception as error:  # the policy can wrap the error of the missing sensor
            if _caused_by_sensor(error):
                continue
            raise
        unread.append(sensor.value)
    if unread:
        # The policy may read them later: a hint, not a failure.
        return f"{' and '.join(unread)} on the card but not read in {steps} steps"
    return ", ".join(sorted(policy.card.sensors)) or "none needed"


def _caused_by_sensor(error: BaseException) -> bool:
    """Return whether a missing sensor caused an error. The chain of causes can be circular."""
    cause: BaseException | None = error
    visited: set[int] = set()
    while cause is not None and id(cause) not in visited:
        if isinstance(cause, SensorNotDeclaredError):
            return True
        visited.add(id(cause))
        cause = cause.__cause__ or cause.__context__
    return False


def _blind(policy: Policy, task: Task) -> str:
    policy.begin(task)
    return answer(policy, task, synthetic_observation(policy, 0, blind=True)).action.value


def durations_s(policy: Policy, task: Task, steps: int) -> list[float]:
    """Return the time of each decision in a synthetic episode, wall time in seconds."""
    policy.begin(task)
    measured = []
    for number in range(steps):
        observation = synthetic_observation(policy, number)
        start_s = time.perf_counter()
        policy.act(observation)
        measured.append(time.perf_counter() - start_s)
    return measured


def _time(policy: Policy, task: Task, steps: int) -> str:
    measured_s = durations_s(policy, task, steps)
    return f"{statistics.median(measured_s) * 1000:.1f} ms per step (median), {max(measured_s) * 1000:.1f} ms maximum"


def first_difference(first: list[Decision], again: list[Decision]) -> int:
    """Return the number of the first action that differs, with its parameters, from 1; 0 if none differs."""
    pairs = enumerate(zip(first, again, strict=True), 1)
    return next((number for number, (a, b) in pairs if _executed(a) != _executed(b)), 0)


def _executed(decision: Decision) -> tuple[object, ...]:
    return decision.action, decision.movement, decision.parts


def _line(error: BaseException) -> str:
    return str(error) if isinstance(error, VsnbenchError) else error_line(error) + _meant(error)


def _meant(error: BaseException) -> str:
    """Return a suggestion for a mistyped member of an enumeration, such as Action; else an empty string."""
    if not isinstance(error, AttributeError) or type(error.obj) is not EnumType or not isinstance(error.name, str):
        return ""
    near = closest(error.name, error.obj.__members__)
    return f": did you mean {near}?" if near else ""


def line_and_place(error: BaseException) -> str:
    """Return a model's error and the last line of its own code in the traceback: `KeyError: 3 (mine.py, line 7)`."""
    if isinstance(error, VsnbenchError):
        return _line(error)
    for frame, number in reversed(list(traceback.walk_tb(error.__traceback__))):  # reads no source, so runs no loader
        file = Path(frame.f_code.co_filename)
        if not (file.name.startswith("<") or any(map(file.is_relative_to, _NOT_THE_MODEL))):
            return f"{_line(error)} ({sanitize(file.name)}, line {number})"
    return _line(error)
