"""A RosRobot in a process of its own, spoken to in lines of JSON: `client.py PROFILE PATIENCE_S`."""

import dataclasses
import json
import math
import sys
import time

from vsnbench.errors import NotPlacedError, VsnbenchError
from vsnbench.protocol.actions import Action
from vsnbench.protocol.site import StartingPosition
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.ros_robot import RosRobot


class Client:
    def __init__(self) -> None:
        self.robot = RosRobot(load_profile(sys.argv[1]), patience_s=float(sys.argv[2]))

    def begin(self) -> dict:
        """Begin as a run does: with a person who does what is asked at once, and is asked again."""
        problems = [""]
        while True:
            try:
                self.robot.begin(StartingPosition(number=7, position=(2.0, 1.0), heading_deg=90), 5)
                break
            except NotPlacedError as error:
                problems.append(str(error))
                time.sleep(0.1)
        return {
            "asked": problems if self.robot.needs_a_person else [],
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
            "capture": dataclasses.asdict(self.robot.last_capture),
        }

    def execute(self, action: str) -> dict:
        result = dataclasses.asdict(self.robot.execute(Action(action)))
        return result | {"turn_deg": math.degrees(result["turn_rad"])}

    def locate(self) -> list:
        fix = self.robot.locate()
        return [*dataclasses.astuple(fix.pose), fix.source]

    def halt(self) -> None:
        self.robot.halt()

    def stamp(self) -> float:
        """The newest stamp of the odometry."""
        return self.robot._link.snapshot().latest.stamp_s


client = Client()
sys.stdout.write(json.dumps("ready") + "\n")
sys.stdout.flush()
for line in sys.stdin:
    name, *arguments = json.loads(line)
    try:
        answer = {"answer": getattr(client, name)(*arguments)}
    except VsnbenchError as error:
        answer = {"error": type(error).__name__, "message": str(error)}
    sys.stdout.write(json.dumps(answer, default=str) + "\n")
    sys.stdout.flush()
