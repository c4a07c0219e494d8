"""A RosRobot that executes lines of JSON: `client.py PROFILE PATIENCE_S`."""

import dataclasses
import json
import math
import sys
import time

import numpy as np

from vsnbench.errors import NotPlacedError, SensorLostError, VsnbenchError
from vsnbench.protocol.judge import EndReason, end_after
from vsnbench.protocol.limits import Spent
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros.robot import RosRobot
from vsnbench.runner.episode.path_guard import PathGuard
from vsnbench.sites.site import StartingPosition
from vsnbench.values.encoding.codec import movement_from_json
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action


class Client:
    def __init__(self) -> None:
        self.robot = RosRobot(load_profile(sys.argv[1]), patience_s=float(sys.argv[2]))

    def begin(self, x_m: float = 2.0, y_m: float = 1.0, heading_deg: float = 90) -> dict:
        """Begin an episode as a run does, and retry after a NotPlacedError."""
        problems = [""]
        while True:
            try:
                self.robot.begin(StartingPosition(number=7, position=(x_m, y_m), heading_deg=heading_deg), 5)
                break
            except NotPlacedError as error:
                problems.append(str(error))
                time.sleep(0.1)
        return {
            "asked": problems if self.robot.needs_operator else [],
            "simulated": self.robot.identity.simulated,
            "sensors": sorted(self.robot.sensors),
        }

    def observe(self) -> dict:
        seen = self.robot.observe()
        return {
            "rgb": list(seen.rgb.shape),
            "depth_m": float(seen.depth_m.mean()),
            "stamp_s": seen.stamp_s,
            "depth_stamp_s": seen.depth_stamp_s,
            "pose": dataclasses.astuple(seen.pose),
            "capture": dict(seen.sensing),
            "cameras": {
                role.value: [view.stamp_s - seen.stamp_s, list(view.rgb.shape), float(np.nanmean(view.depth_m))]
                for role, view in seen.cameras.items()
            },
        }

    def execute(self, action: str) -> dict:
        return measured(self.robot.drive(ProtocolParameters().movement_of(Action(action))))

    def step(self, action: str) -> dict:
        """Observe and act, as a step of a run does."""
        self.robot.observe()
        return self.execute(action)

    def drive(self, movement: dict) -> dict:
        """Drive with the guard of a run."""
        guard = PathGuard(self.robot.profile, ProtocolParameters())
        return measured(self.robot.drive(movement_from_json(movement), guard))

    def drive_on(self, movement: dict, seconds: float = 6.0) -> dict:
        """Drive on with the guard of a run, with a new path every 0.3 s, until something ends the motion."""
        guard = PathGuard(self.robot.profile, ProtocolParameters())
        self.robot.observe()
        end_s = (now_s := self.robot.now_s() or 0.0) + seconds
        result = self.robot.advance(now_s, guard)
        while result.completed and now_s < end_s:
            now_s += 0.3
            self.robot.follow(movement_from_json(movement))
            result = result.followed_by(self.robot.advance(now_s, guard))
        return measured(result.followed_by(self.robot.come_to_rest()))

    def kinds(self) -> list:
        return sorted(self.robot.action_kinds)

    def locate(self) -> list:
        fix = self.robot.locate()
        return [*dataclasses.astuple(fix.pose), fix.source]

    def halt(self) -> None:
        self.robot.halt()

    def stamp(self) -> float:
        """The newest stamp of the odometry."""
        return self.robot._link.snapshot().latest.stamp_s


def measured(result: MotionResult) -> dict:
    """Return a result, and the reason for which an episode ends with it."""
    reason = end_after(Spent(), Action.MOVE_FORWARD, result, ProtocolParameters())
    ends = {"turn_deg": math.degrees(result.turn_rad), "end_reason": "continues" if reason is None else reason.value}
    return dataclasses.asdict(result) | ends


client = Client()
sys.stdout.write(json.dumps("ready") + "\n")
sys.stdout.flush()
for line in sys.stdin:
    name, *arguments = json.loads(line)
    try:
        answer = {"answer": getattr(client, name)(*arguments)}
    except VsnbenchError as error:
        reason = EndReason.SENSOR_LOST if isinstance(error, SensorLostError) else EndReason.MOTION_FAILED
        answer = {"error": type(error).__name__, "message": str(error), "code": error.code, "end_reason": reason.value}
    sys.stdout.write(json.dumps(answer, default=str) + "\n")
    sys.stdout.flush()
