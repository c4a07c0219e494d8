"""A policy that is served elsewhere, as a policy like any other: `--model ws://gpu-box:8765`."""

import hashlib
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
from vsnbench.models.contract import ModelCard
from vsnbench.models.remote.card import card_of, difference
from vsnbench.models.remote.connection import Address, Answer, Connection, ModelBusyError
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE
from vsnbench.protocol.codec import decision_from_message, observation_to_message
from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation
from vsnbench.protocol.settings_file import read_settings

logger = logging.getLogger(__name__)

_RETRY_PERIOD_S = 0.5
_LEAVING_S = 2.0
"""A run that has ended is gone before its server has noticed."""
_WORDS_MAX = 500
_TRACEBACK_MAX = 15_000


class RemoteSettings(BaseModel):
    """How a model elsewhere is spoken to."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    rgb: Literal["raw", "jpeg"] = Field(default="raw", description="jpeg: smaller, and not the same pixels")
    depth: Literal["f32", "mm16"] = Field(default="f32", description="mm16: 16-bit millimetres, half the bytes")
    act_timeout_s: float = Field(default=10.0, gt=0, le=600, description="the model is lost when it answers later")
    reset_timeout_s: float = Field(default=60.0, gt=0, le=3600, description="the same for the start of an episode")
    patience_s: float = Field(default=30.0, ge=0, le=3600, description="how long to try to reach it between episodes")


class RemotePolicy:
    """The client of a served policy: the card is the server's, every question has a deadline.

    What does not answer in time is lost (ModelLostError): the episode is void. The next episode connects again, with
    patience, and only to a model with the same card.
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
            act_timeout: seconds; over the settings' `act_timeout_s`.
            token: what the server wants to hear; $VSNBENCH_TOKEN when None.
            unix_path: a socket file of this machine in place of the address.

        Raises:
            UsageError: the address is none.
            ModelError: what answers is no model's server, or refuses.
            ModelLostError: nothing answers.
        """
        given = RemoteSettings()
        if model_config is not None:
            given = read_settings(model_config, RemoteSettings, ModelError, "model settings")
        if act_timeout is not None:
            given = RemoteSettings.model_validate({**given.model_dump(), "act_timeout_s": act_timeout})
        self.settings = given
        self._token = os.environ.get(TOKEN_VARIABLE, "") if token is None else token
        self._address = Address(url, unix_path) if unix_path else Address.parse(url, self._token)
        self._connection: Connection | None = self._first_connection()
        try:
            self.card = self._card_of(self._connection)
        except ModelError:
            self.close()
            raise
        self.deterministic = self._connection.greeting.get("card", {}).get("deterministic", True) is not False
        """As the card says: the same seed and observations give the same actions."""

    def connect(self) -> Connection:
        """Return a new conversation with the server.

        Raises:
            ModelLostError: nothing answers.
            ModelError: what answers is no model's server, or refuses.
        """
        return Connection(self._address, self._token, f"vsnbench {__version__}")

    @property
    def connection(self) -> Connection:
        """The conversation that is open.

        Raises:
            ModelLostError: there is none.
        """
        if self._connection is None:
            raise ModelLostError(f"the model at {self._address} is not connected")
        return self._connection

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode; connects again where the connection was lost.

        Raises:
            ModelLostError: the model cannot be reached, does not answer in time, or is another one now.
            ModelError: the model failed.
        """
        opaque = hashlib.sha256(f"{goal}/{seed}".encode()).hexdigest()[:16]
        question = {"type": "reset", "episode": opaque, "goal": goal, "seed": seed}
        self._ask(self._connected(), question, "ready", self.settings.reset_timeout_s)

    def act(self, observation: Observation) -> Decision:
        """Send what is on the card and return the model's decision.

        Raises:
            ModelLostError: no answer in time.
            ModelError: the model failed, or its answer is no decision.
        """
        connection = self.connection
        question = observation_to_message(observation, rgb=self.settings.rgb, depth=self.settings.depth)
        answer = self._ask(connection, {"type": "act", **question}, "decision", self.settings.act_timeout_s)
        return _decision(answer, self.settings.act_timeout_s)

    def close(self) -> None:
        """Say good-bye."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _first_connection(self) -> Connection:
        """Return the first conversation; the last client may be just leaving."""
        give_up = time.monotonic() + _LEAVING_S
        while True:
            try:
                return self.connect()
            except ModelBusyError:
                if time.monotonic() > give_up:
                    raise
                time.sleep(_RETRY_PERIOD_S / 5)

    def _reconnect(self) -> Connection:
        """Return a new conversation in place of the one that was lost, with patience: somebody starts it again.

        Raises:
            ModelLostError: nothing answers, or what answers refuses.
        """
        give_up = time.monotonic() + self.settings.patience_s
        while True:
            try:
                return self.connect()
            except (ModelLostError, ModelError) as error:  # it may still be at the question that it answered too late
                if time.monotonic() > give_up:
                    raise ModelLostError(error.statement, advice=error.advice) from error
                time.sleep(_RETRY_PERIOD_S)

    def _connected(self) -> Connection:
        if self._connection is None:
            connection = self._reconnect()
            try:
                self._recognise(self._card_of(connection))
            except (ModelLostError, ModelError) as error:
                connection.close()
                raise ModelLostError(error.statement, advice=error.advice) from error
            self._connection = connection
        return self._connection

    def _recognise(self, card: ModelCard) -> None:
        if different := difference(self.card, card):
            raise ModelLostError(
                f"the model at {self._address} is another one now ({different}): this campaign needs the one it "
                "began with",
                advice="start the same command again to run the other",
            )
        if card.runs_on != self.card.runs_on:
            where = ", ".join(f"{name} {value}" for name, value in card.runs_on.items())
            logger.warning("the model at %s no longer runs where this run found it, but on %s", self._address, where)

    def _ask(self, connection: Connection, question: Mapping[str, Any], wanted: str, timeout_s: float) -> Answer:
        try:
            answer = connection.ask(question, timeout_s)
        except BaseException:
            self._connection = None
            raise
        kind = answer.message["type"]
        if kind == "error":
            failure = ModelError(str(answer.message.get("message"))[:_WORDS_MAX])
            if trace := str(answer.message.get("traceback") or ""):
                failure.add_note(f"In the model's own process:\n{trace[:_TRACEBACK_MAX]}")
            raise failure
        if kind != wanted:
            self.close()
            raise ModelError(f"the model answers {question['type']} with {kind!r:.40} in place of {wanted}")
        return answer

    def _card_of(self, connection: Connection) -> ModelCard:
        """Return the card of the greeting, checked.

        Raises:
            ModelError: it is no card, or the server cannot decode what the settings send.
        """
        if self.settings.rgb == "jpeg" and connection.greeting.get("jpeg") is not True:
            raise ModelError(
                f"the model at {self._address} cannot decode JPEG", advice="install opencv or pillow there"
            )
        # What is lost on the way is part of what was tested.
        lost: dict[str, str] = {}
        if self.settings.rgb != "raw":
            lost["wire_rgb"] = self.settings.rgb
        if self.settings.depth != "f32":
            lost["wire_depth"] = self.settings.depth
        try:
            return card_of(connection.greeting, lost)
        except ModelError as error:
            raise ModelError(f"the model at {self._address}: {error}") from error


def _decision(answer: Answer, act_timeout_s: float) -> Decision:
    """Return the decision of an answer, checked whole, with what the way cost among its details.

    Raises:
        ModelError: it names no action, or carries what cannot be shown and recorded.
    """
    message = answer.message
    decision = decision_from_message(message)
    seconds = message.get("seconds")
    way = {
        "round_trip_s": answer.round_trip_s,
        "infer_s": float(seconds) if isinstance(seconds, int | float) else None,
        "sent_bytes": answer.sent_bytes,
        "received_bytes": answer.received_bytes,
        "act_timeout_s": act_timeout_s,
    }
    kept = replace(decision.diagnostics, details={**decision.diagnostics.details, "wire": way})
    return replace(decision, diagnostics=kept)
