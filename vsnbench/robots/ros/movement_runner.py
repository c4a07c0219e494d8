"""Runs one movement at a time over ROS: waits, watches, stops the base, and measures by the odometry."""

import logging
import time
from dataclasses import replace

from vsnbench.control.settings import MotionSettings
from vsnbench.errors import NoAnswerError, RobotError, SensorLostError
from vsnbench.robots.ros.image_timing import silent_robot
from vsnbench.robots.ros.path_looks import PathLooks
from vsnbench.robots.ros.start import present
from vsnbench.ros.common.robot_link import RobotLink
from vsnbench.sensing.hazards import Hazard
from vsnbench.sensing.images.camera_images import MotionEnd
from vsnbench.sensing.movement_check import (
    MISS_FACTOR,
    MovementAlarmError,
    contradiction,
    displacement_m,
    overshoot,
    remaining_m,
)
from vsnbench.sensing.odometry.rest_readings import Stillness
from vsnbench.sensing.robot_reports import RobotSnapshot
from vsnbench.sensing.steering import rival_text
from vsnbench.values.motion_result import NOT_BEGUN, Collision, CollisionSource, MotionResult
from vsnbench.values.movement import STOP, Drive
from vsnbench.values.pose import Pose

logger = logging.getLogger(__name__)

_ODOMETRY_TIMEOUT_S = 0.8
_COMMAND_TIMEOUT_S = 0.6
_HANGING_S = 3.0
"""A discrete_move that does not steer for this long during a movement hangs."""
_STANDSTILL_TIMEOUT_S = 1.5
_UNDRIVEN_S = 0.2
"""Longest period between the velocities of a driving server."""
_LONGEST_PAUSE_S = 0.6
"""After a longer pause between two checks, this process was stopped or starved: it heard nothing meanwhile."""
_ANSWERED_FALSE = "discrete_move answered False"
_LAST_HOLD_S = 10.0
"""Longest time for which the base is held against another driving node at the end of the session."""


class MovementRunner:
    """Runs the movements of one robot; every exit leaves it at rest."""

    def __init__(self, link: RobotLink, settings: MotionSettings) -> None:
        self._link = link
        self._settings = settings
        self.origin = Pose(0.0, 0.0)
        """Odometry at the start of the episode."""
        self.end = MotionEnd(0.0, 0.0)
        """End of the last movement."""
        self.before: Pose | None = None
        """Odometry at the begin of the movement after the last observation; None before it begins."""
        self.outcome: MotionResult | None = None
        """What discrete_move reported of the last movement; None for a server that does not report it."""
        self.driven_against = ""
        """Who still drove when the base was last held, or an empty string."""
        self._movement: Drive = STOP
        self._moving = False
        self._requested_s = 0.0
        """Time of the last request, and of the last check (monotonic clock)."""
        self._checked_s = 0.0
        self._listening_since_s = 0.0
        """End of this process's last pause (monotonic clock); silence of the odometry counts from then."""
        self._still = Stillness()
        self._began_s = 0.0
        self._path_m = 0.0
        self._last_pose = Pose(0.0, 0.0)

    def begin(self, now: RobotSnapshot) -> None:
        """Start an episode with the odometry of a snapshot as its origin."""
        assert now.latest is not None  # noqa: S101  # the caller awaited it
        self.origin = now.latest.pose
        self._still = Stillness.of([reading.pose for reading in now.readings])
        self.end = present(now)

    def run(self, movement: Drive, timeout_s: float, looks: PathLooks | None = None) -> MotionResult:
        """Have one movement executed to its end and return the measured motion.

        Args:
            movement: the movement.
            timeout_s: time in which the answer has to arrive.
            looks: checks the way ahead while the robot drives.
        """
        before = self.relative(self.fresh())
        self._began_s = self._link.now_s
        self.begin_to_watch()
        failure, blocked, sensor_lost, answered = "", "", False, False
        self._moving, self._path_m, self.before, self._last_pose = True, 0.0, before, before
        self._movement = movement

        def check() -> None:
            self._check(before, looks)

        try:
            check()
            if looks is not None and movement.ahead > 0:
                looks.require_sight(self._link)
            answered = self._link.drive(movement, timeout_s, None if movement == STOP else check)
            # The outcome is on another topic than the answer.
            self._link.wait_for(lambda now: now.outcome is not None, 0.1 if self._link.reports_outcomes else 0.0)
        except MovementAlarmError as alarm:
            blocked, failure = (str(alarm), "") if alarm.blocked else ("", str(alarm))
            sensor_lost = alarm.sensor_lost
        except NoAnswerError as error:
            failure = str(error)
        outcome = self.outcome = self._link.snapshot().outcome
        if failure or blocked or self._link.snapshot().rival_s > self._requested_s:
            self.force_standstill()
        self._moving = False
        if not failure and not blocked and not answered:
            blocked = outcome.blocked if outcome else ""
            failure = outcome.failure if outcome and outcome.failure else "" if blocked else _ANSWERED_FALSE
            sensor_lost = outcome is not None and outcome.sensor_lost
        after = before
        try:
            after = self._pose_at_rest()
        except SensorLostError as error:
            failure, sensor_lost = failure or str(error), sensor_lost or not failure
        if sensor_lost and (rivals := self._link.snapshot().rivals(self._link.names.odometry_topic, time.monotonic())):
            failure = f"{rivals} ({failure})"
        collision = self.collision() or (outcome.collision if outcome else None)
        miss_m = MISS_FACTOR * self._settings.position_tolerance_m
        if not failure and not blocked and (contradicted := contradiction(movement, before, after, miss_m)):
            failure = f"discrete_move answered True to {movement.text}, but {contradicted}"
        return self._measured(
            before,
            after,
            MotionResult(
                completed=not failure and not blocked and collision is None,
                collision=collision,
                failure=failure,
                corrections=outcome.corrections if outcome else 0,
                blocked="" if failure else blocked,
                sensor_lost=sensor_lost,
            ),
        )

    def interrupted(self) -> MotionResult:
        """Return the motion since `before`, which an exception ended. Called after `halt`.

        Raises:
            SensorLostError: the odometry is old.
        """
        if self.before is None:
            return NOT_BEGUN
        return self._measured(self.before, self.relative(self.fresh()), MotionResult(completed=False))

    def _measured(self, before: Pose, after: Pose, result: MotionResult) -> MotionResult:
        """Return a result with the motion between two poses of the odometry."""
        driven_m = self._path_m + self._last_pose.distance_to(after)
        return replace(
            result,
            displacement_m=displacement_m(self._movement, before, after),
            turn_rad=after.heading_rad - before.heading_rad,
            duration_s=self._link.now_s - self._began_s,
            pose=after,
            path_m=None if self._movement.holds_heading else driven_m,
        )

    def halt(self) -> None:
        """Command zero velocity, and hold it while a movement may be running."""
        if self._moving:
            self.force_standstill()
            self._moving = False
        else:
            self._link.stand_still()

    def close(self) -> None:
        """Halt, and hold the base for a while if another node still drives it."""
        self.halt()
        if self._link.holding:
            self._link.wait_for(self._undriven_at_rest, _LAST_HOLD_S)

    def fresh(self) -> RobotSnapshot:
        """Return the present snapshot.

        Raises:
            SensorLostError: the odometry is old.
        """
        now = self._link.snapshot()
        if (silent_s := now.odometry_age_s(time.monotonic())) > _ODOMETRY_TIMEOUT_S:
            if now.odometry_fault:
                raise SensorLostError(now.odometry_fault.text)
            raise _no_odometry(self._link.names.odometry_topic, silent_s)
        return now

    def relative(self, now: RobotSnapshot) -> Pose:
        """Return the newest odometry relative to the start of the episode."""
        return now.latest.pose.relative_to(self.origin) if now.latest else Pose(0.0, 0.0)

    def begin_to_watch(self) -> None:
        """Allow others to steer the base, and count what is reported from now on; see `require_no_alarm`."""
        self._requested_s = self._checked_s = self._listening_since_s = time.monotonic()
        self.driven_against = ""
        self._link.release()

    def _check(self, before: Pose, looks: PathLooks | None) -> None:
        """Check the newest reports during a movement from `before` on.

        Raises:
            MovementAlarmError: the movement has to end at once.
        """
        now = self._link.snapshot()
        self.require_no_alarm(now)
        pose = self.relative(now)
        if overshot := overshoot(self._movement, before, pose):
            raise MovementAlarmError(f"{self._link.names.discrete_move} was stopped: {overshot}")
        self._path_m += self._last_pose.distance_to(pose)
        self._last_pose = pose
        if looks is not None:
            looks.look(now, remaining_m(self._movement, before, pose))
        if self._link.names.command:  # a motion adapter steers by other means than velocities on a topic
            self.require_steered(now)

    def require_steered(self, now: RobotSnapshot) -> None:
        """Stop a base that nothing steers.

        Raises:
            MovementAlarmError: what should steer it hangs.
        """
        unsteered_s = time.monotonic() - max(now.steered_s, self._requested_s)
        if unsteered_s > _COMMAND_TIMEOUT_S:
            # Nothing steers: stop the base, whatever its last command was.
            self._link.stand_still()
        if unsteered_s > _HANGING_S:
            raise MovementAlarmError(
                f"{self._link.names.discrete_move} has not steered for {unsteered_s:.0f} s: restart its server"
            )

    def require_no_alarm(self, now: RobotSnapshot) -> None:
        """Make sure that the base reports no hazard, and that its odometry is sound and this process alone steers it.

        Raises:
            MovementAlarmError: it does.
        """
        names, now_s = self._link.names, time.monotonic()
        if now_s - self._checked_s > _LONGEST_PAUSE_S:
            self._listening_since_s = now_s
        self._checked_s = now_s
        for hazard, where in now.hazard_events:
            raise MovementAlarmError(f"{hazard.value} ({where})")
        if now.contact:
            raise MovementAlarmError(f"touched {now.contact}")
        if now.rival_s > self._requested_s and not self._link.others_drive:
            raise MovementAlarmError(rival_text(now.rival, names.command))
        if now.odometry_fault:
            raise MovementAlarmError(now.odometry_fault.text, sensor_lost=True)
        if (silent_s := min(now.odometry_age_s(now_s), now_s - self._listening_since_s)) > _ODOMETRY_TIMEOUT_S:
            lost = silent_robot(names, now, now_s) or _no_odometry(names.odometry_topic, silent_s)
            raise MovementAlarmError(str(lost), sensor_lost=True)

    def collision(self) -> Collision | None:
        """Return the contact that the base has reported since the episode began, or None."""
        now = self._link.snapshot()
        bumped = [where for hazard, where in now.hazard_events if hazard is Hazard.BUMPER]
        if bumped:
            return Collision(CollisionSource.BUMPER, now.contact or bumped[0])
        return Collision(CollisionSource.CONTACT, now.contact) if now.contact else None

    def force_standstill(self) -> None:
        """Hold the base until it is at rest and no node drives it.

        A node that still drives is answered with zero velocities until the next movement.
        """
        self._link.hold_still()
        try:
            self._link.drive(STOP, 0.5)
        except RobotError as error:
            logger.warning("discrete_move does not stop: %s", error)
        if not self._link.wait_for(self._undriven_at_rest, _STANDSTILL_TIMEOUT_S):
            now = self._link.snapshot()
            if now.odometry_age_s(time.monotonic()) > _ODOMETRY_TIMEOUT_S:
                logger.warning("without odometry it is not known whether the base is at rest: look at it")
            else:
                self.driven_against = now.driven_by
                logger.warning("%s still drives: the base is held at zero velocity; end that node", now.driven_by)
        self._link.stand_still()

    def _undriven_at_rest(self, now: RobotSnapshot) -> bool:
        return time.monotonic() - now.driven_s > _UNDRIVEN_S and self.at_rest(now)

    def _pose_at_rest(self) -> Pose:
        """Return the pose once the odometry is at rest; a base with a lag rolls on after the answer."""
        self._link.wait_for(self.at_rest, _STANDSTILL_TIMEOUT_S)
        now = self.fresh()
        self.end = present(now)
        return self.relative(now)

    def at_rest(self, now: RobotSnapshot) -> bool:
        """Return whether the odometry has not changed for as long as the base needs to settle."""
        return now.at_rest(self._settings.settle_s, self._still.position_m, self._still.heading_rad)


def _no_odometry(topic: str, silent_s: float) -> SensorLostError:
    """Return the error of silent odometry."""
    return SensorLostError(
        f"no odometry on {topic} for {silent_s:.1f} s", advice="check the driver of the base", code="no-odometry"
    )
