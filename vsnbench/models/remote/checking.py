"""Tries a model's server against docs/wire.md: for people who write servers."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsnbench.errors import ModelError, ModelLostError, VsnbenchError
from vsnbench.models.remote.connection import Connection
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.categories import GOAL_CATEGORIES
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation, shown_to_policy
from vsnbench.protocol.pose import Pose

STEPS = 20
_SEED = 11
_SIZES = ((640, 480), (640, 360), (33, 17))


@dataclass(frozen=True, slots=True)
class WireFinding:
    """One thing that was tried."""

    what: str
    passed: bool
    seen: str


def check_server(url: str, model_config: Path | None = None) -> tuple[WireFinding, ...]:
    """Try everything that the wire asks of a server, each with what was seen.

    Raises:
        UsageError: the address is none.
        ModelError: what answers is no model's server.
        ModelLostError: nothing answers.
    """
    policy = RemotePolicy(url, model_config)
    try:
        card = policy.card
        sensors = ", ".join(sorted(sensor.value for sensor in card.sensors)) or "no sensors"
        goals = "any goal" if card.goals is None else ", ".join(sorted(card.goals))
        findings = [WireFinding("hello", True, f"{card.name}; {sensors}; {goals}")]
        goal = min(card.goals & set(GOAL_CATEGORIES)) if card.goals else GOAL_CATEGORIES[0]
        trials: dict[str, Callable[[], str]] = {
            "reset, twice": lambda: _reset_twice(policy, goal),
            "one seed, one answer": lambda: _repeats(policy, goal),
            "a goal that it does not know": lambda: _unknown_goal(policy, goal),
            "other image sizes": lambda: _sizes(policy, goal),
            "a question that does not exist": lambda: _unknown_question(policy, goal),
            "one client at a time": lambda: _second_client(policy),
            "time": lambda: _time(policy, goal),
        }
        for what, trial in trials.items():
            try:
                findings.append(WireFinding(what, True, trial()))
            except VsnbenchError as error:
                findings.append(WireFinding(what, False, str(error)))
        return tuple(findings)
    finally:
        policy.close()


def _look(policy: RemotePolicy, number: int, width: int = 640, height: int = 480) -> Observation:
    rng = np.random.default_rng(number)
    rgb = rng.integers(0, 256, (height, width, 3), np.uint8)
    depth_m = rng.uniform(0.4, 8.0, (height, width)).astype(np.float32)
    depth_m[:, : width // 8] = np.nan
    camera = Camera(width=width, height=height, horizontal_fov_deg=60, mount_height_m=0.6)
    seen = Observation(rgb, depth_m, Pose(0.25 * number, 0.0, 0.1 * number), float(number), camera)
    return shown_to_policy(seen, policy.card.sensors)


def _episode(policy: RemotePolicy, goal: str, seed: int, steps: int) -> list[Decision]:
    policy.reset(goal, seed)
    return [policy.act(_look(policy, number)) for number in range(steps)]


def _reset_twice(policy: RemotePolicy, goal: str) -> str:
    policy.reset(goal, _SEED)
    policy.reset(goal, _SEED)
    return f"{goal}, seed {_SEED}"


def _repeats(policy: RemotePolicy, goal: str) -> str:
    first, again = (_episode(policy, goal, _SEED, STEPS) for _ in range(2))
    different = [number for number, (a, b) in enumerate(zip(first, again, strict=True), 1) if a.action != b.action]
    if different and policy.deterministic:
        raise ModelError(
            f"action {different[0]} differs on the same seed and images",
            advice="draw every random number from the seed of `reset`, or say `deterministic: False` on the card",
        )
    return f"{STEPS} actions, {'as the card says, not repeated' if different else 'the same twice'}"


def _unknown_goal(policy: RemotePolicy, goal: str) -> str:
    try:
        policy.reset("no such goal", _SEED)
    except ModelLostError:
        raise
    except ModelError as error:
        policy.reset(goal, _SEED)
        return f"refused: {error}"
    if policy.card.goals is None:
        return "taken, as the card says: any goal"
    raise ModelError("taken, and the card names the goals that it knows", advice="raise an error in `reset`")


def _sizes(policy: RemotePolicy, goal: str) -> str:
    for width, height in _SIZES:
        policy.reset(goal, _SEED)
        try:
            policy.act(_look(policy, 1, width, height))
        except ModelLostError:
            raise
        except ModelError as error:
            raise ModelError(f"{width} x {height}: {error}") from error
    return ", ".join(f"{width} x {height}" for width, height in _SIZES)


def _unknown_question(policy: RemotePolicy, goal: str) -> str:
    answer = policy.connection.ask({"type": "sing"}, policy.settings.act_timeout_s)
    if answer.message.get("type") != "error":
        raise ModelError(f"answered with {answer.message.get('type')!r:.40} in place of error")
    policy.reset(goal, _SEED)
    return "answered with an error, and went on"


def _second_client(policy: RemotePolicy) -> str:
    connection: Connection | None = None
    try:
        connection = policy.connect()
    except ModelError as error:
        return f"a second one is turned away: {error.statement.split('refuses: ')[-1]}"
    finally:
        if connection is not None:
            connection.close()
    raise ModelError("a second client is let in while the first is there: their episodes would mix")


def _time(policy: RemotePolicy, goal: str) -> str:
    ways = [decision.diagnostics.details["wire"] for decision in _episode(policy, goal, _SEED, STEPS)]
    whole = statistics.median(way["round_trip_s"] for way in ways) * 1000
    own = [way["infer_s"] for way in ways if way["infer_s"] is not None]
    inference = f", {statistics.median(own) * 1000:.1f} ms of it the model's own" if own else ""
    return f"{whole:.1f} ms a step at the median{inference}; {ways[0]['sent_bytes'] / 1e6:.2f} MB sent"
