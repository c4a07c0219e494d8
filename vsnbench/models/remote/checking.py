"""Checks a model's server against docs/wire.md."""

import logging
import statistics
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from vsnbench.errors import ModelError
from vsnbench.models.contract_check import (
    STEPS,
    ContractFinding,
    answer,
    camera_findings,
    card_summary,
    episode,
    example_tasks,
    first_difference,
    goals,
    repeats,
    reset_twice,
    sizes,
    try_each,
    unknown_goal,
)
from vsnbench.models.remote.policy import RemotePolicy
from vsnbench.models.step_sizes import wrong_assumptions
from vsnbench.models.synthetic import synthetic_observation
from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.robot_profile import RobotProfile

logger = logging.getLogger(__name__)


def check_server(
    url: str,
    model_config: Path | None = None,
    parameters: ProtocolParameters | None = None,
    profile: RobotProfile | None = None,
) -> Iterator[ContractFinding]:
    """Run every check of the wire protocol, and yield each result as it is known.

    The trained camera is compared with that of a robot's profile.

    Raises:
        UsageError: the address is invalid.
        ModelError: the server is not that of a model.
        ModelLostError: no server answers.
    """
    policy = RemotePolicy(url, model_config)
    try:
        for difference in wrong_assumptions(policy.card, parameters or ProtocolParameters()):
            logger.warning("%s", difference)
        tasks = example_tasks(policy.card, profile)
        task = tasks[0]
        yield ContractFinding("hello", True, card_summary(policy))
        yield from camera_findings(policy, profile)
        yield from try_each(
            {
                "goals": lambda: goals(policy, tasks),
                "reset twice": lambda: reset_twice(policy, task),
                "same seed, same actions": lambda: repeats(policy, task, deterministic=policy.card.deterministic),
                "unknown goal": lambda: unknown_goal(policy, task),
                "other image sizes": lambda: sizes(policy, task),
                "unknown request": lambda: _unknown_question(policy, task),
                **(
                    {"one client at a time": lambda: _second_client(policy)}
                    if policy.sessions == 1
                    else {"sessions are independent": lambda: _sessions(policy, url, model_config, task)}
                ),
                "time": lambda: _time(policy, task),
            }
        )
    finally:
        policy.close()


def _unknown_question(policy: RemotePolicy, task: Task) -> str:
    answer = policy.connection.ask({"type": "sing"}, policy.settings.act_timeout_s)
    if answer.message.get("type") != "error":
        raise ModelError(f"answered with {answer.message.get('type')!r:.40} instead of error")
    policy.begin(task)
    return "answered with an error, then continued"


def _second_client(policy: RemotePolicy) -> str:
    try:
        policy.connect().close()
    except ModelError as error:
        return f"a second client is refused: {error.statement.split('refuses: ')[-1]}"
    raise ModelError("a second client is accepted during the first: their episodes would mix")


def _sessions(policy: RemotePolicy, url: str, model_config: Path | None, task: Task) -> str:
    """Run an episode again, with another client's episode at the same time."""
    alone, together = episode(policy, task), []
    other = RemotePolicy(url, model_config)
    try:
        policy.begin(task)
        for number in range(STEPS):
            if number % 3 == 1:
                other.begin(replace(task, seed=task.seed + number))
            together.append(answer(policy, task, synthetic_observation(policy, number)))
            if number:
                other.act(synthetic_observation(policy, STEPS - number))
    finally:
        other.close()
    number = first_difference(alone, together)
    if number and policy.card.deterministic:
        raise ModelError(
            f"action {number} differs when another client runs an episode at the same time",
            advice="keep everything about an episode in its state, or serve the model with --sessions 1",
            code="sessions-mix",
        )
    same = "not repeatable, as on the card" if number else "the same actions next to another client"
    return f"{policy.sessions} sessions; {same}"


def _time(policy: RemotePolicy, task: Task) -> str:
    transfers = [decision.diagnostics.details["wire"] for decision in episode(policy, task)]
    whole = statistics.median(transfer["round_trip_s"] for transfer in transfers) * 1000
    own = [transfer["infer_s"] for transfer in transfers if transfer["infer_s"] is not None]
    inference = f", {statistics.median(own) * 1000:.1f} ms of it in the model" if own else ""
    return f"{whole:.1f} ms per step (median){inference}; {transfers[0]['sent_bytes'] / 1e6:.2f} MB sent"
