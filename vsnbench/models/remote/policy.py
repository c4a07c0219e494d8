"""The client of a model that another process serves: `--model ws://gpu-box:8765`."""

import logging
import os
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from vsnbench import __version__
from vsnbench.errors import ModelError, ModelLostError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.remote.card import card_of
from vsnbench.models.remote.connection import Connection, ServerAnswer
from vsnbench.models.remote.peer import Address, ModelBusyError
from vsnbench.models.remote.reset_message import next_goal_message, reset_message
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE
from vsnbench.models.task import Task
from vsnbench.settings.yaml_file import read_settings
from vsnbench.text.sanitize import sanitize, without_controls
from vsnbench.values.decision import Decision
from vsnbench.values.encoding.codec import decision_from_message, observation_to_message
from vsnbench.values.observation import Observation

logger = logging.getLogger(__name__)

_RETRY_PERIOD_S = 0.5
_LEAVING_S = 2.0
"""Time for a server to notice the end of the previous run."""
_MESSAGE_MAX = 500
_TRACEBACK_MAX = 15_000


class RemoteSettings(BaseModel):
    """Settings of the connection to a served model."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rgb: Literal["raw", "jpeg"] = Field(default="raw", description="jpeg: smaller, with changed pixels")
    depth: Literal["f32", "mm16"] = Field(default="f32", description="mm16: 16-bit millimetres, half the bytes")
    act_timeout_s: float = Field(
        default=10.0, gt=0, le=600, description="time for an action; afterwards the model is lost"
    )
    reset_timeout_s: float = Field(
        default=60.0, gt=0, le=3600, description="time for the start of an episode, and for a connection's first action"
    )
    patience_s: float = Field(default=30.0, ge=0, le=3600, description="time to reconnect between episodes")


class RemotePolicy(Policy):
    """The client of a served policy. It has the server's card, and every request has a deadline.

    The first action of a connection has the time of `reset`, because many models compile or allocate at it.

    If an answer is late, the model is lost (ModelLostError) and the episode is void. The next episode connects again,
    and only to a model with the same card.
    """

    def __init__(
        self,
        url: str,
        model_config: Path | None = None,
        act_timeout: float | None = None,
        token: str | None = None,
        unix_path: str = "",
    ) -> None:
        """Connect to the model.

        Args:
            url: `ws://host:port` or `wss://host:port`.
            model_config: YAML file of `RemoteSettings`.
            act_timeout: seconds for an action, as `limit_actions`.
            token: the server's token; None for $VSNBENCH_TOKEN.
            unix_path: local socket file to use instead of the address.

        Raises:
            UsageError: the address is invalid.
            ModelError: the server is not that of a model, or refuses.
            ModelLostError: no server answers.
        """
        self.settings = RemoteSettings()
        if model_config is not None:
            self.settings = read_settings(model_config, RemoteSettings, ModelError, "model settings")
        if act_timeout is not None:
            self.limit_actions(act_timeout)
        self._token = os.environ.get(TOKEN_VARIABLE, "") if token is None else token
        self._address = Address(url, unix_path) if unix_path else Address.parse(url, self._token)
        self._acted_on: Connection | None = None
        """The connection that has answered an action."""
        self._connection: Connection | None = self._first_connection()
        try:
            self.card = self._card_of(self._connection)
        except ModelError:
            self.close()
            raise

    def limit_actions(self, act_timeout_s: float) -> None:
        """Replace the settings' time limit for an action, in seconds."""
        self.settings = RemoteSettings.model_validate({**self.settings.model_dump(), "act_timeout_s": act_timeout_s})

    def connect(self) -> Connection:
        """Return a new connection to the server.

        Raises:
            ModelLostError: no server answers.
            ModelError: the server is not that of a model, or refuses.
        """
        return Connection(self._address, self._token, f"vsnbench {__version__}")

    @property
    def sessions(self) -> int:
        """Number of clients that the server takes at a time; 1 for a server that does not state it."""
        given: Any = self.connection.greeting.get("sessions")
        return given if isinstance(given, int) and given > 0 else 1

    @property
    def connection(self) -> Connection:
        """The open connection.

        Raises:
            ModelLostError: there is none.
        """
        if self._connection is None:
            raise ModelLostError(f"the model at {self._address} is not connected")
        return self._connection

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode without a task. Connects again if the connection was lost.

        Raises:
            ModelLostError: the model cannot be reached, does not answer in time, or has another card.
            ModelError: the model failed.
        """
        self._begin_episode(goal, seed)

    def begin(self, task: Task) -> None:
        """Start an episode; raises as `reset` does."""
        self._begin_episode(task.goal, task.seed, task)

    def _begin_episode(self, goal: str, seed: int, task: Task | None = None) -> None:
        connection = self._connected()
        request = reset_message(goal, seed, task)
        self._ask(connection, request, "ready", self.settings.reset_timeout_s)

    def next_goal(self, goal: str) -> None:
        """Send the next goal of a sequence.

        Raises:
            ModelLostError: no answer in time.
            ModelError: the model failed.
        """
        self._ask(self.connection, next_goal_message(goal), "ready", self.settings.reset_timeout_s)

    def act(self, observation: Observation) -> Decision:
        """Send the sensors on the card and return the model's decision.

        Raises:
            ModelLostError: no answer in time.
            ModelError: the model failed, or its answer is not a decision.
        """
        connection = self.connection
        content = observation_to_message(observation, rgb=self.settings.rgb, depth=self.settings.depth)
        limit_s = self.settings.act_timeout_s
        if connection is not self._acted_on:  # many models compile or allocate at their first action
            limit_s = max(limit_s, self.settings.reset_timeout_s)
        answer = self._ask(connection, {"type": "act", **content}, "decision", limit_s)
        self._acted_on = connection
        return _decision(answer, limit_s)

    def close(self) -> None:
        """Close the connection."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _first_connection(self) -> Connection:
        """Return the first connection, waiting for a previous client to disconnect."""
        give_up = time.monotonic() + _LEAVING_S
        while True:
            try:
                return self.connect()
            except ModelBusyError:
                if time.monotonic() > give_up:
                    raise
                time.sleep(_RETRY_PERIOD_S / 5)

    def _reconnect(self) -> Connection:
        """Connect again, for up to `patience_s` seconds."""
        give_up = time.monotonic() + self.settings.patience_s
        while True:
            try:
                return self.connect()
            except (ModelLostError, ModelError) as error:  # it may still compute a late answer
                if time.monotonic() > give_up:
                    raise ModelLostError(error.statement, advice=error.advice, code=error.code) from error
                time.sleep(_RETRY_PERIOD_S)

    def _connected(self) -> Connection:
        if self._connection is None:
            connection = self._reconnect()
            try:
                self._check_same_model(self._card_of(connection))
            except (ModelLostError, ModelError) as error:
                connection.close()
                raise ModelLostError(error.statement, advice=error.advice, code=error.code) from error
            self._connection = connection
        return self._connection

    def _check_same_model(self, card: ModelCard) -> None:
        if different := self.card.difference(card):
            raise ModelLostError(
                f"the model at {self._address} has changed ({different}), which this campaign does not allow",
                advice="start the same command again to run the new model",
                code="other-model",
            )
        if card.runs_on != self.card.runs_on:
            platform = ", ".join(f"{name} {value}" for name, value in card.runs_on.items())
            logger.warning("the model at %s now runs on another platform: %s", self._address, platform)

    def _ask(self, connection: Connection, request: Mapping[str, Any], expected: str, timeout_s: float) -> ServerAnswer:
        try:
            answer = connection.ask(request, timeout_s)
        except BaseException:
            self._connection = None
            raise
        kind = answer.message["type"]
        if kind == "error":
            failure = ModelError(sanitize(str(answer.message.get("message"))[:_MESSAGE_MAX]))
            if trace := str(answer.message.get("traceback") or ""):
                failure.add_note(f"In the model's own process:\n{without_controls(trace[:_TRACEBACK_MAX])}")
            raise failure
        if kind != expected:
            self.close()
            raise ModelError(
                f"the model answered {request['type']} with {kind!r:.40} instead of {expected}", code="invalid-answer"
            )
        return answer

    def _card_of(self, connection: Connection) -> ModelCard:
        """Return the card of the greeting."""
        if self.settings.rgb == "jpeg" and connection.greeting.get("jpeg") is not True:
            raise ModelError(
                f"the model at {self._address} cannot decode JPEG", advice="install opencv or pillow there"
            )
        # A lossy encoding changes the model's input, so it is part of the model's identity.
        lost: dict[str, str] = {}
        if self.settings.rgb != "raw":
            lost["wire_rgb"] = self.settings.rgb
        if self.settings.depth != "f32":
            lost["wire_depth"] = self.settings.depth
        try:
            return card_of(connection.greeting, lost)
        except ModelError as error:
            statement = f"the model at {self._address}: {error.statement}"
            raise ModelError(statement, advice=error.advice, code="invalid-card") from error


def _decision(answer: ServerAnswer, act_timeout_s: float) -> Decision:
    """Return the decision of an answer, with the duration and size of the transfer among its details."""
    message = answer.message
    decision = decision_from_message(message)
    seconds = message.get("seconds")
    queued, batch = message.get("queued"), message.get("batch")
    transfer = {
        "round_trip_s": answer.round_trip_s,
        "infer_s": float(seconds) if isinstance(seconds, int | float) else None,
        "queued_s": float(queued) if isinstance(queued, int | float) else None,
        "batch": batch if isinstance(batch, int) else 1,
        "sent_bytes": answer.sent_bytes,
        "received_bytes": answer.received_bytes,
        "act_timeout_s": act_timeout_s,
    }
    diagnostics = replace(decision.diagnostics, details={**decision.diagnostics.details, "wire": transfer})
    return replace(decision, diagnostics=diagnostics)
