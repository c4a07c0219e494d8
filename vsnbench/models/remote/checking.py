"""Tries a model's server against docs/wire.md: for people who write servers."""

import statistics
from pathlib import Path

from vsnbench.errors import ModelError
from vsnbench.models.contract_check import (
    SEED,
    ContractFinding,
    card_in_words,
    episode,
    known_goal,
    repeats,
    reset_twice,
    sizes,
    try_each,
    unknown_goal,
)
from vsnbench.models.remote.connection import Connection
from vsnbench.models.remote.policy import RemotePolicy


def check_server(url: str, model_config: Path | None = None) -> tuple[ContractFinding, ...]:
    """Try everything that the wire asks of a server, each with what was seen.

    Raises:
        UsageError: the address is none.
        ModelError: what answers is no model's server.
        ModelLostError: nothing answers.
    """
    policy = RemotePolicy(url, model_config)
    try:
        goal = known_goal(policy)
        return (
            ContractFinding("hello", True, card_in_words(policy)),
            *try_each(
                {
                    "reset, twice": lambda: reset_twice(policy, goal),
                    "one seed, one answer": lambda: repeats(policy, goal, deterministic=policy.deterministic),
                    "a goal that it does not know": lambda: unknown_goal(policy, goal),
                    "other image sizes": lambda: sizes(policy, goal),
                    "a question that does not exist": lambda: _unknown_question(policy, goal),
                    "one client at a time": lambda: _second_client(policy),
                    "time": lambda: _time(policy, goal),
                }
            ),
        )
    finally:
        policy.close()


def _unknown_question(policy: RemotePolicy, goal: str) -> str:
    answer = policy.connection.ask({"type": "sing"}, policy.settings.act_timeout_s)
    if answer.message.get("type") != "error":
        raise ModelError(f"answered with {answer.message.get('type')!r:.40} in place of error")
    policy.reset(goal, SEED)
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
    ways = [decision.diagnostics.details["wire"] for decision in episode(policy, goal, SEED)]
    whole = statistics.median(way["round_trip_s"] for way in ways) * 1000
    own = [way["infer_s"] for way in ways if way["infer_s"] is not None]
    inference = f", {statistics.median(own) * 1000:.1f} ms of it the model's own" if own else ""
    return f"{whole:.1f} ms a step at the median{inference}; {ways[0]['sent_bytes'] / 1e6:.2f} MB sent"
