"""The robot at the other end of a ROS 1 network: client of discrete_move, camera and odometry (paper, Section 3.1.4).

Every wait has an end, every way out commands zero velocity, and what discrete_move answers is checked against the
odometry: upstream's server answers True whatever happened.
"""

import logging
import math
import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

from vsnbench.errors import RobotError, SensorLostError
from vsnbench.motion.law import direction, ideal_duration_s
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import ROS1, RobotIdentity
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.contract import Attendant
from vsnbench.robots.ros1_camera import CAMERA_TIMEOUT_S, LookReport, RosCamera
from vsnbench.robots.ros1_start import (
    await_zeroed_odometry,
    have_it_placed_by_a_person,
    have_it_placed_by_the_simulator,
    wait_until_ready,
)
from vsnbench.ros1.installation import require_ros
from vsnbench.ros1.interface import ros1_interface
from vsnbench.ros1.service_call import ServiceError
from vsnbench.sensing.discrete_mover import MOVEMENTS, Hazard, Outcome
from vsnbench.sensing.pairing import MotionEnd

logger = logging.getLogger(__name__)

PATIENCE_S = 30.0
"""How long the parts of a robot may take to come up, or to come back, before an episode."""
_ODOMETRY_TIMEOUT_S = 0.8
_COMMAND_TIMEOUT_S = 0.6
_WEDGED_S = 3.0
"""Nobody steers for this long in the middle of a movement: discrete_move is wedged."""
_STANDSTILL_TIMEOUT_S = 1.5
_STILL_M, _STILL_RAD = 0.001, math.radians(0.05)
_LIE_M, _LIE_RAD = 0.10, math.radians(10)
"""A server that says True while the odometry is off by more than this has not done what was asked. Upstream's own
tolerance of 0.08 rad, and its overshoot on a base with a lag, stay well below."""
_WORD_OF = {action: word for word, action in MOVEMENTS.items()}


class _AlarmError(Exception):
    """Something happened during a movement that must end it at once."""

    def __init__(self, reason: str, *, sensor_lost: bool = False) -> None:
        super().__init__(reason)
        self.sensor_lost = sensor_lost


class RosRobot:
    """A real robot, or one that is played by `vsnbench ros simulate`: the code is the same.

    One a process. `halt` may be called from another thread.
    """

    def __init__(
        self,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        attendant: Attendant | None = None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        require_ros()
        from vsnbench.ros1.robot_link import RobotLink

        self.profile = profile
        self.attendant = attendant
        self._parameters = parameters if parameters is not None else ProtocolParameters()
        self._settings = MotionSettings.for_robot(profile, self._parameters)
        self._patience_s = patience_s
        self.last_look: LookReport | None = None
        self.last_outcome: Outcome | None = None
        """What our own discrete_move told about the last movement; None from a server that tells nothing."""
        self._start: Pose | None = None
        self._end = MotionEnd(0.0, 0.0)
        self._moving = False
        self._asked_s = 0.0
        self._link = RobotLink(profile)
        try:
            wait_until_ready(self._link, profile, patience_s)
            self.simulated = self._link.can_be_placed
            self.needs_a_person = not self.simulated
            if self.simulated:
                self._link.join_simulation()
        except BaseException:
            self._link.close()
            raise
        self._camera = RosCamera(self._link, profile)
        self.sensors = frozenset(
            {Sensor.RGB, Sensor.ODOMETRY}
            | ({Sensor.DEPTH} if ros1_interface(profile).depth else set())
            | ({Sensor.INSTANCES} if self._camera.labelled else set())
        )
        self.conditions: Mapping[str, Any] = {"depth_frames": self._camera.depth_frames}

    @property
    def identity(self) -> RobotIdentity:
        """Who it is; whether it is simulated is what the network says."""
        return RobotIdentity(self.profile, ROS1, simulated=self.simulated)

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Stand at `start`, placed by the simulator or by a person, with every part of the robot answering.

        Raises:
            RobotError: a part does not answer within the patience, or the robot cannot stand there.
        """
        self._start = None
        self._link.master.wait(self._patience_s)
        wait_until_ready(self._link, self.profile, self._patience_s)
        if self.simulated:
            have_it_placed_by_the_simulator(self._link, start, seed, self._patience_s)
        else:
            have_it_placed_by_a_person(self._link, start, self.attendant, self.profile)
        self._link.begin_episode(2.0)
        await_zeroed_odometry(self._link, self.profile)
        with self._link.news:
            self._link.clear_hazards()
            self._link.tracker.rebase()
            self._end = self._now()
        self._start = start.pose

    def observe(self) -> Observation:
        """Return images taken after the last motion ended, the depth being the median of several.

        Raises:
            SensorLostError: a camera or the odometry is silent, or sends what is not in the profile.
        """
        self._require_begun()
        images = self._camera.look(self._end)
        with self._link.news:
            self._require_fresh_odometry()
            pose = self._link.tracker.relative
        self.last_look = images.report
        return Observation(
            rgb=images.rgb,
            depth_m=images.depth_m,
            pose=pose,
            stamp_s=images.stamp_s,
            camera=self.profile.camera,
            instances=images.instances,
            depth_stamp_s=images.depth_stamp_s,
            sensing=images.report.numbers,
        )

    def execute(self, action: Action) -> MotionResult:
        """Have discrete_move carry out one action, and measure what the odometry says about it."""
        self._require_begun()
        with self._link.news:
            self._require_fresh_odometry()
            before = self._link.tracker.relative
        began_s, self._asked_s = self._link.now_s, time.monotonic()
        failure, sensor_lost, answered = "", False, False
        self._moving = True
        try:
            self._watch()
            answered = self._ask(action)
        except _AlarmError as alarm:
            failure, sensor_lost = str(alarm), alarm.sensor_lost
        except ServiceError as error:
            failure = str(error)
        if failure:
            self._force_standstill()
        self._moving = False
        outcome = self.last_outcome = self._link.outcome
        if not failure and not answered:
            failure = outcome.reason if outcome and outcome.reason else "discrete_move answered False"
            sensor_lost = outcome is not None and outcome.sensor_lost
        after = before
        try:
            after = self._pose_at_rest()
        except SensorLostError as error:
            failure, sensor_lost = failure or str(error), sensor_lost or not failure
        collision = self._collision()
        return MotionResult(
            completed=not (failure := failure or self._lie(action, before, after)) and collision is None,
            displacement_m=_along(before, after),
            turn_rad=after.heading_rad - before.heading_rad,
            duration_s=self._link.now_s - began_s,
            collision=collision,
            failure=failure,
            corrections=outcome.corrections if outcome else 0,
            pose=after,
            sensor_lost=sensor_lost,
        )

    def locate(self) -> Fix:
        """Return the simulator's truth, or what the odometry makes of the surveyed start."""
        self._require_begun()
        with self._link.news:
            if self.simulated:
                if self._link.truth is None or time.monotonic() - self._link.truth.arrival_s > CAMERA_TIMEOUT_S:
                    raise SensorLostError("the simulator is silent: is vsnbench ros simulate running?")
                return Fix(self._link.truth.payload, PoseSource.SIMULATED)
            assert self._start is not None  # noqa: S101  # _require_begun
            return Fix(self._start.compose(self._link.tracker.relative), PoseSource.ESTIMATED)

    def halt(self) -> None:
        """Command zero velocity, and insist on it while a movement may still be under way."""
        if self._moving:
            self._force_standstill()
            self._moving = False
        else:
            self._link.stand_still()

    def close(self) -> None:
        """Halt and leave the ROS network."""
        self.halt()
        self._link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, action: Action) -> bool:
        angle_deg = round(self._parameters.turn_deg) if action.turns else 0
        limit_s = ideal_duration_s(action, self._settings) + self._settings.timeout_s + 2.0
        answered = self._link.move(
            _WORD_OF[action], angle_deg, limit_s, self._watch if action is not Action.STOP else None
        )
        # Our own server says on a topic what the answer's bool cannot; upstream's says nothing.
        self._link.wait_for(lambda: self._link.outcome is not None, 0.1 if self._link.tells_outcomes else 0.0)
        return answered

    def _watch(self) -> None:
        """Raise when something has happened for which no movement may go on."""
        link, now_s = self._link, time.monotonic()
        with link.news:
            for hazard, where in link.hazard_events:
                raise _AlarmError(f"{hazard.value} ({where})")
            if link.contact:
                raise _AlarmError(f"touched {link.contact}")
            if link.odometry_fault:
                raise _AlarmError(link.odometry_fault, sensor_lost=True)
            if (silent_s := self._odometry_age_s()) > _ODOMETRY_TIMEOUT_S:
                raise _AlarmError(_no_odometry(self.profile, silent_s), sensor_lost=True)
        unsteered_s = now_s - max(link.commanded_s, self._asked_s)
        if unsteered_s > _COMMAND_TIMEOUT_S:
            # Nobody steers: whatever the base was told last, it is told to stand now.
            link.stand_still()
        if unsteered_s > _WEDGED_S:
            raise _AlarmError(f"{link.names.discrete_move} has not steered for {unsteered_s:.0f} s: restart its server")

    def _collision(self) -> Collision | None:
        with self._link.news:
            touched = self._link.contact
            bumped = [where for hazard, where in self._link.hazard_events if hazard is Hazard.BUMPER]
        if bumped:
            return Collision(CollisionSource.BUMPER, touched or bumped[0])
        return Collision(CollisionSource.CONTACT, touched) if touched else None

    def _lie(self, action: Action, before: Pose, after: Pose) -> str:
        """Return in words how far the odometry contradicts an answer of True; empty when it does not."""
        way = self._settings.way(action) * direction(action)
        asked_m, asked_rad = (0.0, way) if action.turns else (way, 0.0)
        moved_m, turned_rad = _along(before, after), after.heading_rad - before.heading_rad
        if abs(moved_m - asked_m) <= _LIE_M and abs(turned_rad - asked_rad) <= _LIE_RAD:
            return ""
        return (
            f"discrete_move answered True to {_WORD_OF[action]}, but the odometry moved {moved_m * 100:.1f} cm and "
            f"turned {math.degrees(turned_rad):.1f}° instead of {asked_m * 100:g} cm and {math.degrees(asked_rad):g}°"
        )

    def _force_standstill(self) -> None:
        """Command zero velocity until the odometry stands still; against a server that goes on driving, too."""
        self._link.stand_still()
        try:
            self._link.move("Stop", 0, 0.5)
        except RobotError as error:
            logger.warning("discrete_move cannot be told to stop: %s", error)
        give_up_s = time.monotonic() + _STANDSTILL_TIMEOUT_S
        while time.monotonic() < give_up_s:
            self._link.stand_still()
            if self._link.wait_for(self._at_rest, 0.02):
                break
        self._link.stand_still()

    def _pose_at_rest(self) -> Pose:
        """Return the pose once the odometry stands still; a base with a lag rolls on after the answer."""
        self._link.wait_for(self._at_rest, _STANDSTILL_TIMEOUT_S)
        with self._link.news:
            self._require_fresh_odometry()
            self._end = self._now()
            return self._link.tracker.relative

    def _at_rest(self) -> bool:
        """Return whether the readings of the last moments are all the same place."""
        readings = self._link.readings
        if not readings:
            return False
        newest = readings[-1]
        for reading in reversed(readings):
            if reading.pose.distance_to(newest.pose) > _STILL_M:
                return False
            if abs(reading.pose.heading_rad - newest.pose.heading_rad) > _STILL_RAD:
                return False
            if newest.stamp_s - reading.stamp_s >= self._settings.settle_s - 1e-3:
                return True
        return False

    def _odometry_age_s(self) -> float:
        latest = self._link.tracker.latest
        return math.inf if latest is None else time.monotonic() - latest.arrival_s

    def _require_fresh_odometry(self) -> None:
        if (silent_s := self._odometry_age_s()) > _ODOMETRY_TIMEOUT_S:
            raise SensorLostError(_no_odometry(self.profile, silent_s))

    def _now(self) -> MotionEnd:
        """Return the present on the robot's clock and on ours."""
        latest = self._link.tracker.latest
        return MotionEnd(latest.stamp_s if latest else 0.0, time.monotonic())

    def _require_begun(self) -> None:
        if self._start is None:
            raise RobotError("the robot stands nowhere yet: begin an episode first")


def _no_odometry(profile: RobotProfile, silent_s: float) -> str:
    return f"no odometry on {ros1_interface(profile).odometry} for {silent_s:.1f} s: is the base's driver running?"


def _along(before: Pose, after: Pose) -> float:
    """Return the distance between two poses, negative where the second lies behind the first."""
    distance_m = before.distance_to(after)
    return distance_m if after.relative_to(before).x_m >= 0 else -distance_m
