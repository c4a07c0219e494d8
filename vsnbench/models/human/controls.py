"""The controls of a robot that a person drives: what the driver is shown, and the actions that the driver chooses.

The main thread offers trials and pictures, and waits for the answers. The driver's page shows them and answers from its
own thread. The runner says whether the guard has refused an action. The controls hold nothing else, so nothing else can
reach the page: no pose, plan, distance or verdict.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from queue import Empty, SimpleQueue
from typing import Final

from vsnbench.errors import ModelError, ModelLostError, VsnbenchError
from vsnbench.values.movement import Action
from vsnbench.values.observation import Budget

CHOICES: Final = frozenset(
    {Action.MOVE_FORWARD, Action.MOVE_BACKWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.STOP}
)
"""Actions that a driver can choose."""
SILENT_S: Final = 10.0
"""A page sends a message every second. After this time without one, another browser can take the controls."""


NO_LIMITS: Final = Budget(None)


class ControlsError(VsnbenchError):
    """Another browser has the controls, or the choice came too late."""

    code = "driven-already"


class Phase(StrEnum):
    """What the driver can do."""

    PREPARING = "preparing"
    """Wait for the next trial."""
    READY = "ready"
    """Begin the trial, whose goal is known."""
    CHOOSING = "choosing"
    """Choose an action for the newest picture."""
    MOVING = "moving"
    """Wait for the next picture: the robot carries out the action."""
    ENDED = "ended"
    """The session is over."""


@dataclass(frozen=True, slots=True)
class View:
    """What the driver is shown, apart from the picture."""

    phase: Phase = Phase.PREPARING
    trial: int = 0
    """Number of the trial in this session."""
    goal: str = ""
    """The goal in words; empty for a photograph."""
    photo: bytes | None = None
    """JPEG of an image goal."""
    success_distance_m: float | None = None
    """Distance to the goal below which STOP is a success; None if the driver is not told."""
    leg: int = 1
    """Number of the goal in its sequence."""
    picture: int = 0
    """Number of the newest picture in this session."""
    budget: Budget = NO_LIMITS
    """What the protocol leaves."""
    refused: bool = False
    """Whether the guard has refused the last action, or ended it early."""


class Controls:
    """The controls of one session. One browser at a time has them."""

    def __init__(self, driver: str) -> None:
        """Start without a trial.

        Args:
            driver: name of the person who drives, which is recorded with the trials.
        """
        self.driver = driver
        self.act_timeout_s: float | None = None
        """Time limit for an action, from when its picture was shown; None for no limit."""
        self.practice = False
        """The trials of this session are not recorded."""
        self.refused = False
        """Whether the guard has refused the last action; shown with the next picture."""
        self.is_served = False
        """Whether the driver's page is open for connections; a person needs it to drive."""
        self.view = View()
        self.picture_jpeg = b""
        """The newest picture of the robot's camera."""
        self.listeners: list[Callable[[], None]] = []
        """Called when the view has changed, from any thread."""
        self._lock = threading.Lock()
        self._answers: SimpleQueue[Action | None] = SimpleQueue()
        """What the page answers to the current offer; None for a picture that is shown now."""
        self._holder = ""
        self._heard_s = 0.0

    # Called by the page, from its thread.

    def is_held_by(self, visitor: str) -> bool:
        """Return whether a browser has the controls."""
        return bool(visitor) and self._holder == visitor

    @property
    def is_free(self) -> bool:
        """Whether no browser has the controls, or the one that has them is gone."""
        return not self._holder or time.monotonic() - self._heard_s > SILENT_S

    def hear(self, visitor: str) -> None:
        """Register a sign of life of a browser."""
        if self._holder == visitor:
            self._heard_s = time.monotonic()

    def take(self, visitor: str) -> None:
        """Take the controls, and begin the trial that is offered, if one is.

        Raises:
            ControlsError: another browser has the controls (`driven-already`).
        """
        with self._lock:
            if not self.is_free:
                self._require(visitor)
            self._holder, self._heard_s = visitor, time.monotonic()
            if self.view.phase is Phase.READY:
                self.view = replace(self.view, phase=Phase.MOVING)
                self._answers.put(None)
        self._notify()

    def choose(self, visitor: str, picture: int, action: Action) -> None:
        """Choose an action for the newest picture.

        Raises:
            ControlsError: another browser has the controls (`driven-already`), or the picture is not the newest one or
                has its action (`answered-meanwhile`).
        """
        with self._lock:
            self._require(visitor)
            if self.view.phase is not Phase.CHOOSING or self.view.picture != picture:
                raise ControlsError(
                    "this picture has its action already", advice="wait for the next one", code="answered-meanwhile"
                )
            self.view = replace(self.view, phase=Phase.MOVING)
            self._answers.put(action)
        self._notify()

    def shown(self, visitor: str, picture: int) -> None:
        """Register that the driver sees a picture: the time limit of its action begins."""
        with self._lock:
            if self._holder == visitor and self.view.phase is Phase.CHOOSING and self.view.picture == picture:
                self._answers.put(None)

    def _require(self, visitor: str) -> None:
        if self._holder != visitor:
            raise ControlsError(
                f"{self.driver} drives this robot in another browser",
                advice="close that page first, or start a run for another driver: --model human:NAME",
                code="driven-already",
            )

    # Called by the policy, from the main thread. `SimpleQueue.get` lets a request to stop interrupt it.

    def offer_trial(self, goal: str, photo: bytes | None = None, success_distance_m: float | None = None) -> None:
        """Offer a trial and wait, without a time limit, until the driver begins it.

        Raises:
            ModelError: no page serves the controls.
        """
        if not self.is_served:
            raise ModelError(
                "a person cannot drive here: only `vsnbench run` serves the driver's page",
                advice=f"vsnbench run --model human:{self.driver} --goal chair",
                code="no-driver-page",
            )
        self.refused, trial = False, self.view.trial + 1
        self._renew(View(Phase.READY, trial, goal, photo, success_distance_m, picture=self.view.picture)).get()

    def show_goal(self, goal: str, photo: bytes | None = None) -> None:
        """Show the next goal of the trial."""
        self.refused = False
        self._renew(replace(self.view, goal=goal, photo=photo, leg=self.view.leg + 1))

    def ask(self, picture_jpeg: bytes, budget: Budget) -> Action:
        """Show a picture, and return the action that the driver chooses.

        Raises:
            ModelLostError: no action was chosen within the time limit, which begins when the picture is shown.
        """
        self.picture_jpeg = picture_jpeg
        picture = self.view.picture + 1
        view = replace(self.view, phase=Phase.CHOOSING, picture=picture, budget=budget, refused=self.refused)
        answers = self._renew(view)
        ends_s: float | None = None
        while True:
            try:
                answer = answers.get(timeout=None if ends_s is None else max(ends_s - time.monotonic(), 0.0))
            except Empty:
                raise ModelLostError(
                    f"{self.driver} chose no action within {self.act_timeout_s:g} s of the picture"
                ) from None
            if answer is not None:
                return answer
            if ends_s is None and self.act_timeout_s is not None:
                ends_s = time.monotonic() + self.act_timeout_s

    def end_trial(self) -> None:
        """Show that the trial is over, whatever its end."""
        self._renew(replace(self.view, phase=Phase.PREPARING))

    def close(self) -> None:
        """Show that the session is over."""
        self._renew(replace(self.view, phase=Phase.ENDED))

    def _renew(self, view: View) -> "SimpleQueue[Action | None]":
        """Replace the view, and discard answers to the previous one."""
        with self._lock:
            self.view, self._answers = view, SimpleQueue()
            answers = self._answers
        self._notify()
        return answers

    def _notify(self) -> None:
        for listener in list(self.listeners):
            listener()
