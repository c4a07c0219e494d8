"""A robot that a motion adapter moves: `interface.kind: adapter` (docs/motion-adapter.md).

The adapter's answers are compared with its odometry. Every wait has a limit, and every exit sends `stop`.
"""

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.control.legs import longest_duration_s
from vsnbench.control.settings import MotionSettings
from vsnbench.errors import NoAnswerError, NotPlacedError, RobotError, SensorLostError
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.adapter.images import observed
from vsnbench.robots.adapter.link import IMAGES_S, AdapterLink
from vsnbench.robots.adapter.messages import AdapterState, result_in, stamp_in
from vsnbench.robots.adapter.progress import MovementWatch
from vsnbench.robots.contract import Robot, Watch
from vsnbench.sensing.movement_check import MISS_FACTOR, MovementAlarmError, contradiction, displacement_m
from vsnbench.sites.site import StartingPosition
from vsnbench.values.battery import Battery
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import NOT_BEGUN, MotionResult
from vsnbench.values.movement import STOP, ActionKind, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_identity import ADAPTER, RobotIdentity
from vsnbench.values.robot_profile import RobotProfile

PATIENCE_S = 30.0
"""Time in which an adapter has to answer before an episode."""
_RETRY_S = 0.25
_NEW_IMAGES_S = 3.3
"""Time for images that were captured after the last movement."""


class AdapterRobot(Robot):
    """A robot behind a motion adapter."""

    def __init__(
        self, profile: RobotProfile, parameters: ProtocolParameters | None = None, patience_s: float = PATIENCE_S
    ) -> None:
        """Connect to the adapter of a profile.

        Raises:
            RobotError: it does not answer, is none, speaks another version, or simulates another robot.
        """
        self.profile = profile
        self._settings = MotionSettings.for_robot(profile, parameters)
        self._patience_s = patience_s
        self._link = AdapterLink(profile, self._settings)
        card, account = self._link.card, self._link.card.simulation
        self.is_rehearsal = account is not None and account.is_rehearsal
        self.needs_operator = account is None or self.is_rehearsal
        self.sensors = card.sensors
        self.action_kinds = card.movements & profile.drive_kinds | {ActionKind.DISCRETE}
        self.conditions: Mapping[str, Any] = {
            "adapter": card.condition,
            **profile.tolerance_conditions,
            **(account.conditions if account else {}),
        }
        self._start: Pose | None = None
        self._end_stamp_s = 0.0
        """Stamp of the end of the last movement; images must be newer."""
        self._seen_m: npt.NDArray[np.float32] | None = None
        """Depth of the last observation."""
        self._before: Pose | None = None
        self._watch: MovementWatch | None = None

    @property
    def identity(self) -> RobotIdentity:
        """Profile of the robot, and whether the adapter simulates it."""
        account = self._link.card.simulation
        site = account.site_sha256 if account else ""
        return RobotIdentity(self.profile, ADAPTER, simulated=account is not None, site_sha256=site)

    @property
    def battery(self) -> Battery | None:
        """Last report of the battery."""
        return self._link.battery

    def wait_until_ready(self) -> None:
        """Wait until the adapter answers; see `Robot`."""
        give_up_s = time.monotonic() + self._patience_s
        while True:
            try:
                self._link.read()
            except NoAnswerError:
                if time.monotonic() > give_up_s:
                    raise
                time.sleep(_RETRY_S)
            else:
                return

    def simulate_placement(self, start: StartingPosition, seed: int) -> None:
        """Have the adapter's simulator put the robot down near its mark."""
        self._link.place(start, seed)

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Start an episode; an adapter that simulates puts the robot at `start`.

        Raises:
            NotPlacedError: a hazard sensor is active.
            RobotError: the adapter does not answer, or another program drives the robot.
        """
        self._start, self._before, self._watch = None, None, None
        self._link.forget_odometry()
        self.wait_until_ready()
        if not self.needs_operator:
            self._link.place(start, seed)
        state = self._link.begin(seed)
        if state.hazards:
            raise NotPlacedError(
                f"the base reports: {', '.join(sorted(state.hazards))}",
                advice="put the robot flat on its wheels or feet, away from what it touches",
            )
        if state.rival:
            raise RobotError(
                f"{state.rival} is driving the robot",
                advice="end that program, or wait until it stops driving",
                code="base-is-driven",
            )
        self._end_stamp_s = state.stamp_s
        self._start = start.pose

    def set_start_pose(self, pose: Pose) -> None:
        """Take the measured pose as the start of the estimated trajectory."""
        self._start = pose

    def observe(self) -> Observation:
        """Return images captured after the last movement.

        Raises:
            SensorLostError: the images are old, or do not fit the profile.
            RobotError: the adapter does not answer.
        """
        self._require_begun()
        self._before = None
        began_s = time.monotonic()
        while True:
            message = self._link.live().request("observe", IMAGES_S)
            if (stamp_s := stamp_in(message)) >= self._end_stamp_s:
                break
            if time.monotonic() - began_s > _NEW_IMAGES_S:
                raise SensorLostError(
                    f"the adapter's images are {self._end_stamp_s - stamp_s:.2f} s older than the end of the movement",
                    advice="stamp images and odometry by one clock, and answer `observe` with new images",
                    code="old-images",
                )
            time.sleep(_RETRY_S / 5)
        pose = self._link.take(AdapterState.of({**message, "depth": None}))
        waited_s = time.monotonic() - began_s
        observation = observed(message, self.profile.camera, pose, {"waited_s": waited_s}, self.sensors)
        self._seen_m = observation.depth_m
        return observation

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        """Have the adapter execute a movement, and measure it by the odometry."""
        self._require_begun()
        before = self._pose_at_rest()
        self._before = before
        if movement.goes_sideways and ActionKind.SIDESTEP not in self.action_kinds:
            return MotionResult(completed=False, failure="the adapter executes no movement to the side", pose=before)
        looks = watch if Sensor.DEPTH in self.sensors and movement.is_watched else None
        self._watch = watched = MovementWatch(movement, before, self.profile.camera, looks, self._link.take)
        watched.prepare(self._seen_m)
        began_s = time.monotonic()
        result, stopped = MotionResult(completed=True), ""
        try:
            if movement == STOP:
                self._link.live().stop()
            else:
                done, stopped = self._link.live().drive(
                    movement.to_json(),
                    longest_duration_s(movement, self._settings),
                    watched.take,
                    watch=looks is not None,
                )
                result = result_in(done, simulated=self.identity.simulated)
                watched.end(done)
        except RobotError as error:
            result = MotionResult(completed=False, failure=str(error), sensor_lost=isinstance(error, SensorLostError))
        if stopped:
            result = replace(result, completed=False, failure=stopped, blocked="")
        if (alarm := watched.alarm) is not None:
            result = _alarmed(result, alarm)
        after = before
        try:
            after = self._pose_at_rest()
        except RobotError as error:
            result = replace(result, completed=False, failure=result.failure or str(error))
            after = watched.pose
        miss_m = None if self.profile.tolerances is None else MISS_FACTOR * self.profile.tolerances.position_m
        if result.completed and (contradicted := contradiction(movement, before, after, miss_m)):
            failure = f"the adapter answered that it is done: {movement.text}, but {contradicted}"
            result = replace(result, completed=False, failure=failure)
        return self._measured(watched, after, result, time.monotonic() - began_s)

    def interrupted_motion(self) -> MotionResult | None:
        """Return the odometry's motion since the movement after the last observation began."""
        if self._before is None or self._watch is None:
            return NOT_BEGUN
        result = MotionResult(completed=False)
        return self._measured(self._watch, self._pose_at_rest(), result, self._watch.lasted_s)

    def locate(self) -> Fix:
        """Return the pose of the adapter's simulator, or the start composed with the odometry."""
        self._require_begun()
        state = self._link.read()
        if not self.needs_operator:
            if state.truth is None:
                raise SensorLostError("the adapter simulates, and its `state` has no `truth`", code="silent-simulator")
            return Fix(Pose(*state.truth), PoseSource.SIMULATED)
        assert self._start is not None  # noqa: S101  # _require_begun
        return Fix(self._start.compose(self._link.pose), PoseSource.ESTIMATED)

    def halt(self) -> None:
        """Tell the adapter to stop; an adapter that has lost its client stops by itself."""
        self._link.stop()

    def close(self) -> None:
        """Halt and disconnect."""
        self._link.close()

    def _pose_at_rest(self) -> Pose:
        pose, self._end_stamp_s = self._link.pose_at_rest()
        return pose

    def _measured(self, watched: MovementWatch, after: Pose, result: MotionResult, lasted_s: float) -> MotionResult:
        """Return a result with the motion since a movement began, by the odometry."""
        before, movement = watched.before, watched.movement
        return replace(
            result,
            displacement_m=displacement_m(movement, before, after),
            turn_rad=after.heading_rad - before.heading_rad,
            duration_s=watched.lasted_s if self.identity.simulated else lasted_s,
            pose=after,
            path_m=None if movement.holds_heading else watched.path_m + watched.pose.distance_to(after),
        )

    def _require_begun(self) -> None:
        if self._start is None:
            raise RobotError("the robot has no pose yet", advice="begin an episode first", code="not-begun")


def _alarmed(result: MotionResult, alarm: MovementAlarmError) -> MotionResult:
    """Return the result of a movement that this client stopped."""
    return replace(
        result,
        completed=False,
        failure="" if alarm.blocked else str(alarm),
        blocked=str(alarm) if alarm.blocked else "",
        sensor_lost=alarm.sensor_lost,
    )
