"""The robot at the other end of a ROS network, 1 or 2: movements, camera and odometry (paper, Section 3.1.4).

Every wait has an end, every way out commands zero velocity, and what discrete_move answers is checked against the
odometry: upstream's server answers True whatever happened.
"""

import logging
import math
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Self

from vsnbench.errors import NoAnswerError, RobotError, SensorLostError
from vsnbench.motion.law import ideal_duration_s
from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.fix import Fix, PoseSource
from vsnbench.protocol.motion_result import Collision, CollisionSource, MotionResult
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import RobotIdentity, SimulationAccount
from vsnbench.protocol.robot_profile import RobotProfile
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.contract import ReadBattery
from vsnbench.robots.interface_kinds import connect
from vsnbench.robots.ros_camera import CAMERA_TIMEOUT_S, CaptureReport, RosCamera
from vsnbench.robots.ros_conditions import await_account, conditions_of, require_same_conditions
from vsnbench.robots.ros_start import (
    Patience,
    await_fresh_odometry,
    have_it_carried,
    have_it_placed_by_the_simulator,
    present,
    require_it_stands,
    wait_until_ready,
)
from vsnbench.sensing.camera_images import MotionEnd
from vsnbench.sensing.discrete_mover import MOVEMENTS, Hazard, Outcome
from vsnbench.sensing.movement_check import AskedMovement, MovementAlarmError, distance_along
from vsnbench.sensing.robot_reports import RobotSnapshot

logger = logging.getLogger(__name__)

PATIENCE_S = 30.0
"""How long the parts of a robot may take to come up, or to come back, before an episode."""
_ODOMETRY_TIMEOUT_S = 0.8
_COMMAND_TIMEOUT_S = 0.6
_WEDGED_S = 3.0
"""Nobody steers for this long in the middle of a movement: discrete_move is wedged."""
_STANDSTILL_TIMEOUT_S = 1.5
_UNDRIVEN_S = 0.2
"""A server that drives commands a velocity more often than this."""
_LAST_HOLD_S = 10.0
"""How long a base is held still against somebody who goes on driving it when the session ends."""
_STILL_M, _STILL_RAD = 0.001, math.radians(0.05)
_WORD_OF = {action: word for word, action in MOVEMENTS.items()}


class RosRobot:
    """A real robot, or one that is played by `vsnbench ros1 simulate` or `ros2 simulate`: the code is the same.

    One a process. `halt` may be called from another thread.
    """

    def __init__(
        self,
        profile: RobotProfile,
        parameters: ProtocolParameters | None = None,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self.profile = profile
        self._parameters = parameters if parameters is not None else ProtocolParameters()
        if (turn_deg := self._parameters.turn_deg) != round(turn_deg):
            raise RobotError(f"discrete_move cannot turn by {turn_deg:g}°", advice="take whole degrees as turn_deg")
        self._settings = MotionSettings.for_robot(profile, self._parameters)
        self._patience_s = patience_s
        self.last_capture: CaptureReport | None = None
        self.last_outcome: Outcome | None = None
        """What our own discrete_move reported of the last movement; None from a server that reports nothing."""
        self._start: Pose | None = None
        self._origin = Pose(0.0, 0.0)
        """Where the odometry stood at the start of the episode."""
        self._end = MotionEnd(0.0, 0.0)
        self._moving = False
        self._asked_s = 0.0
        self._link = connect(profile, self._parameters)
        self._simulation: SimulationAccount | None = None
        try:
            patience = Patience(patience_s)
            wait_until_ready(self._link, patience)
            if self._link.can_be_placed:
                self._link.join_simulation()
                self._simulation = await_account(self._link, profile, patience)
            self.is_carried_in_play = self._simulation is not None and self._simulation.pretends_to_be_real
            self.needs_a_person = self._simulation is None or self.is_carried_in_play
            self._camera = RosCamera(self._link, profile)
            self.glimpse = self._camera.glimpse
            self.battery: ReadBattery = lambda: self._link.snapshot().battery
            frames = self._camera.depth_frames
            self.conditions: Mapping[str, Any] = conditions_of(self._link, self._simulation, frames)
        except BaseException:
            self._link.close()
            raise
        self.sensors = frozenset(
            {Sensor.RGB, Sensor.ODOMETRY}
            | ({Sensor.DEPTH} if self._link.names.depth else set())
            | ({Sensor.INSTANCES} if self._camera.labelled else set())
        )

    @property
    def identity(self) -> RobotIdentity:
        """Who it is; whether it is simulated, and in which site, is what the other end says."""
        played = self._simulation.site_sha256 if self._simulation else ""
        return RobotIdentity(self.profile, self._link.kind, simulated=self._simulation is not None, site_sha256=played)

    def make_ready(self) -> None:
        """Wait until every part of the robot answers.

        Raises:
            RobotError: a part does not answer within the patience.
        """
        wait_until_ready(self._link, Patience(self._patience_s))

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Stand at `start`, where the simulator puts it or a person has, with every part of the robot answering.

        Odometry counts from there: its present pose is remembered, and the base is asked for nothing.

        Raises:
            NotPlacedError: a wheel hangs in the air, or something is pressed.
            RobotError: a part does not answer within the patience, is another than when the session began, or the
                robot cannot stand there.
        """
        self._start = None
        patience = Patience(self._patience_s)
        wait_until_ready(self._link, patience)
        patience.insist_on(lambda: require_same_conditions(self._link, self._simulation, self.conditions))
        if not self.needs_a_person:
            have_it_placed_by_the_simulator(self._link, start, seed, patience)
        else:
            require_it_stands(self._link)
        patience.insist_on(lambda: self._link.begin_episode(min(patience.left_s, 2.0)))
        await_fresh_odometry(self._link, patience)
        self._link.clear_events()
        now = self._link.snapshot()
        assert now.latest is not None  # noqa: S101  # awaited above
        self._origin = now.latest.pose
        self._end = present(now)
        self._start = start.pose

    def carry(self, start: StartingPosition, seed: int) -> None:
        """Have whoever plays the robot put it down near the mark; nearer, where it stands there already."""
        have_it_carried(self._link, start, seed, Patience(self._patience_s))

    def stands_at(self, pose: Pose) -> None:
        """Take that the episode began there, as it was measured."""
        self._start = pose

    def observe(self) -> Observation:
        """Return images taken after the last motion ended, the depth being the median of several.

        Raises:
            SensorLostError: a camera or the odometry is silent, or sends what is not in the profile.
        """
        self._require_begun()
        images = self._camera.capture(self._end)
        pose = self._relative(self._fresh())
        self.last_capture = images.report
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
        before = self._relative(self._fresh())
        asked = AskedMovement.of(action, self._settings)
        began_s, self._asked_s = self._link.now_s, time.monotonic()
        failure, sensor_lost, answered = "", False, False
        self._moving = True
        self._link.release()
        try:
            self._watch(asked, before)
            answered = self._ask(action, lambda: self._watch(asked, before))
        except MovementAlarmError as alarm:
            failure, sensor_lost = str(alarm), alarm.sensor_lost
        except NoAnswerError as error:
            failure = str(error)
        if failure:
            self._force_standstill()
        self._moving = False
        outcome = self.last_outcome = self._link.snapshot().outcome
        if not failure and not answered:
            failure = outcome.reason if outcome and outcome.reason else "discrete_move answered False"
            sensor_lost = outcome is not None and outcome.sensor_lost
        after = before
        try:
            after = self._pose_at_rest()
        except SensorLostError as error:
            failure, sensor_lost = failure or str(error), sensor_lost or not failure
        if sensor_lost and (rivals := self._link.snapshot().rivals(self._link.names.odometry, time.monotonic())):
            failure = f"{rivals} ({failure})"
        collision = self._collision()
        if not failure and (contradiction := asked.contradiction(before, after)):
            failure = f"discrete_move answered True to {_WORD_OF[action]}, but {contradiction}"
        return MotionResult(
            completed=not failure and collision is None,
            displacement_m=distance_along(before, after),
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
        now = self._link.snapshot()
        if not self.needs_a_person:
            if now.truth is None or time.monotonic() - now.truth.arrival_s > CAMERA_TIMEOUT_S:
                advice = f"is vsnbench {self._link.kind} simulate running?"
                raise SensorLostError("the simulator is silent", advice=advice)
            return Fix(now.truth.payload, PoseSource.SIMULATED)
        assert self._start is not None  # noqa: S101  # _require_begun
        return Fix(self._start.compose(self._relative(now)), PoseSource.ESTIMATED)

    def halt(self) -> None:
        """Command zero velocity, and insist on it while a movement may still be under way."""
        if self._moving:
            self._force_standstill()
            self._moving = False
        else:
            self._link.stand_still()

    def close(self) -> None:
        """Halt and leave the network."""
        self.halt()
        if self._link.holding:
            self._link.wait_for(self._undriven_at_rest, _LAST_HOLD_S)
        self._link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, action: Action, watch: Callable[[], None]) -> bool:
        angle_deg = round(self._parameters.turn_deg) if action.turns else 0
        limit_s = ideal_duration_s(action, self._settings) + self._settings.timeout_s + 2.0
        answered = self._link.move(_WORD_OF[action], angle_deg, limit_s, watch if action is not Action.STOP else None)
        # Our own server reports on a topic what the answer's bool cannot; upstream's reports nothing.
        self._link.wait_for(lambda now: now.outcome is not None, 0.1 if self._link.reports_outcomes else 0.0)
        return answered

    def _watch(self, asked: AskedMovement, before: Pose) -> None:
        """Raise when something has happened for which no movement may go on."""
        link, now, now_s = self._link, self._link.snapshot(), time.monotonic()
        for hazard, where in now.hazard_events:
            raise MovementAlarmError(f"{hazard.value} ({where})")
        if now.contact:
            raise MovementAlarmError(f"touched {now.contact}")
        if now.odometry_fault:
            raise MovementAlarmError(now.odometry_fault.words, sensor_lost=True)
        if (silent_s := now.odometry_age_s(now_s)) > _ODOMETRY_TIMEOUT_S:
            raise MovementAlarmError(str(_no_odometry(link.names.odometry, silent_s)), sensor_lost=True)
        if overshoot := asked.overshoot(before, self._relative(now)):
            raise MovementAlarmError(f"{link.names.discrete_move} was stopped: {overshoot}")
        unsteered_s = now_s - max(now.steered_s, self._asked_s)
        if unsteered_s > _COMMAND_TIMEOUT_S:
            # Nobody steers: whatever the base was told last, it is told to stand now.
            link.stand_still()
        if unsteered_s > _WEDGED_S:
            raise MovementAlarmError(
                f"{link.names.discrete_move} has not steered for {unsteered_s:.0f} s: restart its server"
            )

    def _collision(self) -> Collision | None:
        now = self._link.snapshot()
        bumped = [where for hazard, where in now.hazard_events if hazard is Hazard.BUMPER]
        if bumped:
            return Collision(CollisionSource.BUMPER, now.contact or bumped[0])
        return Collision(CollisionSource.CONTACT, now.contact) if now.contact else None

    def _force_standstill(self) -> None:
        """Hold the base still until it stands and nobody drives it; against a server that goes on, until it is asked.

        Whoever goes on driving is answered with zero velocity, command by command, until the next movement.
        """
        self._link.hold_still()
        try:
            self._link.move("Stop", 0, 0.5)
        except RobotError as error:
            logger.warning("discrete_move cannot be told to stop: %s", error)
        if not self._link.wait_for(self._undriven_at_rest, _STANDSTILL_TIMEOUT_S):
            logger.warning("%s goes on driving: it is held at zero velocity; end it", self._link.snapshot().driven_by)
        self._link.stand_still()

    def _undriven_at_rest(self, now: RobotSnapshot) -> bool:
        return time.monotonic() - now.driven_s > _UNDRIVEN_S and self._at_rest(now)

    def _pose_at_rest(self) -> Pose:
        """Return the pose once the odometry stands still; a base with a lag rolls on after the answer."""
        self._link.wait_for(self._at_rest, _STANDSTILL_TIMEOUT_S)
        now = self._fresh()
        self._end = present(now)
        return self._relative(now)

    def _at_rest(self, now: RobotSnapshot) -> bool:
        return now.at_rest(self._settings.settle_s, _STILL_M, _STILL_RAD)

    def _fresh(self) -> RobotSnapshot:
        """Return the present snapshot.

        Raises:
            SensorLostError: its odometry is old.
        """
        now = self._link.snapshot()
        if (silent_s := now.odometry_age_s(time.monotonic())) > _ODOMETRY_TIMEOUT_S:
            if now.odometry_fault:
                raise SensorLostError(now.odometry_fault.words)
            raise _no_odometry(self._link.names.odometry, silent_s)
        return now

    def _relative(self, now: RobotSnapshot) -> Pose:
        """Return the newest odometry relative to the start of the episode."""
        return now.latest.pose.relative_to(self._origin) if now.latest else Pose(0.0, 0.0)

    def _require_begun(self) -> None:
        if self._start is None:
            raise RobotError("the robot stands nowhere yet", advice="begin an episode first")


def _no_odometry(topic: str, silent_s: float) -> SensorLostError:
    return SensorLostError(f"no odometry on {topic} for {silent_s:.1f} s", advice="is the base's driver running?")
