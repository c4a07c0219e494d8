"""The check-up of a motion adapter: its card, its sensors, and whether it keeps docs/motion-adapter.md."""

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from vsnbench.errors import RobotError
from vsnbench.models.remote.vsnbench_policy import TOKEN_VARIABLE
from vsnbench.robots.adapter.connection import (
    GONE_S,
    IN_USE,
    NEWEST_VERSION,
    PROGRESS_S,
    AdapterConnection,
)
from vsnbench.robots.adapter.images import observed
from vsnbench.robots.adapter.interface import adapter_interface
from vsnbench.robots.adapter.messages import AdapterState, result_in
from vsnbench.robots.checkup.checks import battery_result, turn_result
from vsnbench.robots.checkup.images import HOLES_ADVICE, MAX_HOLES
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.sensing.images.camera_images import share_invalid
from vsnbench.values.encoding.motion_answer import MotionRefusal
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Move
from vsnbench.values.pose import Pose, wrap_angle
from vsnbench.values.robot_profile import RobotProfile, Tolerances

PAGE = "docs/motion-adapter.md"
_TURN_DEG = 30.0
_TURNING_RAD = math.radians(3)
"""A turn has begun."""
_REACTION_S = 0.5
"""Time for `stop`, a deadline, or a lost client to take effect."""
_SILENCE_S = 1.0
"""Time beyond GONE_S in which the client says nothing."""
_DEADLINE_S = 0.4
_IDLE_S = 1.5
_REST_S = 2.0
_STILL_FACTOR = 4.0
"""Motion at rest, in tolerances of the profile, that another driver explains better than noise."""


@dataclass(frozen=True, slots=True)
class _Turn:
    """A turn as it was answered and measured."""

    done: Mapping[str, Any]
    result: MotionResult
    """What the answer reports."""
    turned_rad: float
    rolled_rad: float
    """Turn after the answer."""
    waited_s: float
    """Time from the client's last word to the answer."""
    longest_gap_s: float
    """Longest time between two messages."""
    states: tuple[AdapterState, ...]

    @property
    def stamp_s(self) -> float:
        """Time of the answer on the robot's clock."""
        return AdapterState.of(self.done).stamp_s

    @property
    def word(self) -> str:
        """Its refusal, or `completed`."""
        return "completed" if self.result.completed else str(self.done.get("refusal") or MotionRefusal.FAULT)


class AdapterCheckup:
    """Checks one adapter."""

    def __init__(self, profile: RobotProfile) -> None:
        self._profile = profile
        self._address = adapter_interface(profile).address
        self._token = os.environ.get(TOKEN_VARIABLE, "")
        self._still = profile.tolerances or Tolerances()

    def results(self, *, move: bool) -> Iterator[CheckResult]:
        """Perform all checks; end early without a connection.

        Args:
            move: whether the robot may turn on the spot.
        """
        try:
            connection = AdapterConnection(self._address, self._token)
        except RobotError as error:
            yield CheckResult("adapter", Health.FAILED, error.statement, error.advice)
            return
        try:
            card = connection.card
            kinds = ", ".join(sorted(card.movements))
            simulated = f", simulates {card.simulation.site}" if card.simulation else ""
            seen = f"{card}, protocol {NEWEST_VERSION}; executes {kinds}{simulated}"
            yield CheckResult("adapter", Health.OK, seen)
            yield self._second_client()
            yield from self._sensor_results(connection)
            if move:
                yield from self._turn_results(connection)
        except RobotError as error:
            yield CheckResult("adapter", Health.FAILED, error.statement, error.advice or f"see {PAGE}")
        finally:
            connection.close()

    def _second_client(self) -> CheckResult:
        """Check that no other client can drive the robot at the same time."""
        try:
            AdapterConnection(self._address, self._token).close()
        except RobotError as error:
            if error.code != IN_USE:
                raise
            return CheckResult("second client", Health.OK, "refused while this one is connected")
        advice = f"answer `hello` with the error `busy` while a client is connected ({PAGE})"
        return CheckResult("second client", Health.FAILED, "accepted: two programs could drive at once", advice)

    def _sensor_results(self, connection: AdapterConnection) -> Iterator[CheckResult]:
        """Check odometry, hazards, battery and images of a robot at rest."""
        first = AdapterState.of(connection.request("state"))
        began_s = time.monotonic()
        message = connection.request("observe", 10.0)
        took_s = time.monotonic() - began_s
        time.sleep(max(0.0, _IDLE_S - took_s))
        last = AdapterState.of(connection.request("state"))
        if last.hazards:
            advice = "free the robot, and put it flat on its wheels or feet"
            yield CheckResult("hazards", Health.FAILED, f"the base reports: {', '.join(last.hazards)}", advice)
        moved_m, turned_rad = _between(first, last)
        seen = f"moved {moved_m * 100:.1f} cm and {math.degrees(turned_rad):.1f}° in {_IDLE_S:g} s at rest"
        is_still = moved_m <= _STILL_FACTOR * self._still.position_m and abs(math.degrees(turned_rad)) <= (
            _STILL_FACTOR * self._still.turn_deg
        )
        if last.rival:
            yield CheckResult("second driver", Health.FAILED, f"{last.rival} drives the robot", "end that program")
        elif not is_still:
            advice = "end what drives it, or state its noise as `tolerances` of the profile"
            yield CheckResult("second driver", Health.FAILED, f"{seen}: another program drives, or it drifts", advice)
        else:
            yield CheckResult("odometry", Health.OK, seen)
        if connection.card.simulation is None and last.stamp_s <= first.stamp_s:
            seen = f"stamp {last.stamp_s:g} s, and {first.stamp_s:g} s {_IDLE_S:g} s earlier"
            yield CheckResult("stamps", Health.FAILED, seen, "stamp the odometry by a clock that runs")
        if last.battery is not None:
            yield battery_result(last.battery)
        yield self._image_result(connection, message, first, took_s)

    def _image_result(
        self, connection: AdapterConnection, message: Mapping[str, Any], before: AdapterState, took_s: float
    ) -> CheckResult:
        try:
            image = observed(message, self._profile.camera, Pose(0.0, 0.0), {}, connection.card.sensors)
        except RobotError as error:
            return CheckResult("images", Health.FAILED, error.statement, error.advice)
        camera = image.camera
        holes = 0.0 if image.depth_m is None else share_invalid(image.depth_m)
        depth = "no depth" if image.depth_m is None else f"depth {1 - holes:.0%} valid"
        seen = f"{camera.width}x{camera.height}, {depth}, in {took_s:.2f} s"
        if (late_s := before.stamp_s - image.stamp_s) > _REACTION_S:
            seen = f"{seen}; {late_s:.2f} s older than the odometry before the request"
            advice = "answer `observe` with new images, stamped by the clock of the odometry"
            return CheckResult("images", Health.FAILED, seen, advice)
        if holes > MAX_HOLES and connection.card.simulation is None:  # a simulated robot has no place yet
            return CheckResult("images", Health.WARNING, seen, HOLES_ADVICE)
        return CheckResult("images", Health.OK, seen)

    def _turn_results(self, connection: AdapterConnection) -> Iterator[CheckResult]:
        """Turn to the left and back: as requested, stopped, beyond a deadline, and without a client."""
        turn_rad = math.radians(_TURN_DEG)
        honest = self._turn(connection, turn_rad)
        what = f"Left {_TURN_DEG:g}°"
        result = turn_result(what, turn_rad, honest.turned_rad, answered=honest.result.completed)
        if result.health is not Health.OK:
            reason = honest.result.failure or honest.result.blocked
            advice = reason or f"answer `done` when the odometry has arrived, or refuse with a word of {PAGE}"
            result = replace(result, advice=advice)
        yield result
        yield _progress_result(honest)
        if abs(honest.turned_rad) < _TURNING_RAD:
            return
        stopped = self._turn(connection, -turn_rad, lambda states: "stop" if _turns(states) else "")
        yield _ended("stop", stopped, MotionRefusal.STOPPED, stopped.waited_s, "after `stop`")
        late = self._turn(connection, turn_rad, deadline_s=_DEADLINE_S)
        beyond_s = late.stamp_s - late.states[0].stamp_s - _DEADLINE_S if late.states else late.waited_s
        yield _ended("deadline", late, MotionRefusal.DEADLINE, beyond_s, f"after its deadline of {_DEADLINE_S:g} s")
        yield self._lost_client(connection, -turn_rad)

    def _lost_client(self, connection: AdapterConnection, turn_rad: float) -> CheckResult:
        """Check that the robot stops when its client says nothing any more."""
        silent: list[AdapterState] = []

        def fall_silent(states: list[AdapterState]) -> str:
            if not _turns(states):
                return ""
            silent.append(states[-1])
            time.sleep(GONE_S + _SILENCE_S)
            return "the check is over"

        turn = self._turn(connection, turn_rad, fall_silent)
        if not silent:
            return CheckResult("lost client", Health.WARNING, "not checked: the turn ended before", f"see {PAGE}")
        beyond_s = turn.stamp_s - silent[0].stamp_s - GONE_S
        return _ended("lost client", turn, MotionRefusal.STOPPED, beyond_s, f"after {GONE_S:g} s without `go`")

    def _turn(
        self,
        connection: AdapterConnection,
        turn_rad: float,
        check: Callable[[list[AdapterState]], str] = lambda _: "",
        deadline_s: float = 30.0,
    ) -> _Turn:
        """Have the robot turn; `check` returns why it has to stop."""
        before = self._at_rest(connection)
        states: list[AdapterState] = []
        last_s, longest_s = time.monotonic(), 0.0

        def take(message: Mapping[str, Any]) -> str:
            nonlocal last_s, longest_s
            longest_s = max(longest_s, time.monotonic() - last_s)
            states.append(AdapterState.of(message))
            try:
                return check(states)
            finally:
                last_s = time.monotonic()

        movement = Move(turn_rad=turn_rad, holds_heading=True).to_json()
        done, _ = connection.drive(movement, deadline_s, take, watch=False)
        waited_s = time.monotonic() - last_s
        answered = AdapterState.of(done)
        answer = result_in(done, simulated=connection.card.simulation is not None)
        after = self._at_rest(connection)
        turned_rad, rolled_rad = _between(before, after)[1], _between(answered, after)[1]
        return _Turn(done, answer, turned_rad, rolled_rad, waited_s, longest_s, tuple(states))

    def _at_rest(self, connection: AdapterConnection) -> AdapterState:
        """Return the state once the odometry repeats."""
        state, give_up_s = AdapterState.of(connection.request("state")), time.monotonic() + _REST_S
        while time.monotonic() < give_up_s:
            time.sleep(0.1)
            before, state = state, AdapterState.of(connection.request("state"))
            moved_m, turned_rad = _between(before, state)
            if moved_m <= self._still.position_m and abs(math.degrees(turned_rad)) <= self._still.turn_deg:
                break
        return state


def _between(first: AdapterState, last: AdapterState) -> tuple[float, float]:
    """Return the distance and the turn between two states."""
    return math.dist(first.pose[:2], last.pose[:2]), wrap_angle(last.pose[2] - first.pose[2])


def _turns(states: list[AdapterState]) -> bool:
    return abs(_between(states[0], states[-1])[1]) > _TURNING_RAD


def _progress_result(turn: _Turn) -> CheckResult:
    """Return whether progress came often enough for a guard."""
    seen = f"{len(turn.states)} messages, at most {turn.longest_gap_s:.2f} s apart"
    if turn.states and turn.longest_gap_s <= PROGRESS_S:
        return CheckResult("progress", Health.OK, seen)
    advice = f"send `progress` at least every {PROGRESS_S:g} s while the robot moves ({PAGE})"
    return CheckResult("progress", Health.FAILED if not turn.states else Health.WARNING, seen, advice)


def _ended(what: str, turn: _Turn, expected: MotionRefusal, after_s: float, when: str) -> CheckResult:
    """Return whether a turn ended as it had to: with the right word, in time, and at rest."""
    rolled_deg = abs(math.degrees(turn.rolled_rad))
    seen = f"answered {turn.word} {max(after_s, 0.0):.2f} s {when}; then turned {rolled_deg:.1f}° on"
    if turn.word != expected:
        return CheckResult(what, Health.FAILED, seen, f"stop the robot, and answer `refusal: {expected}` ({PAGE})")
    if after_s > _REACTION_S or rolled_deg > _TURN_DEG / 3:
        return CheckResult(what, Health.FAILED, seen, f"the robot must be at rest within {_REACTION_S:g} s")
    return CheckResult(what, Health.OK, seen)
