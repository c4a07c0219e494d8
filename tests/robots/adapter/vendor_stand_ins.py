"""The SDKs of three robots as far as the examples use them, over a base in virtual time that is late and has a gait.

What each does follows its documentation:

- Unitree (unitree_sdk2_python, go2/sport/sport_client.py): `Move` sends api 1008 without a reply and returns 0 when it
  was sent; `StopMove` (1003) ends it. SportModeState has the position by the robot's own odometry and the attitude in
  `imu_state.rpy`. `GetImageSample` returns a code and a JPEG. Nothing says how long a velocity holds: it holds.
- Spot (bosdyn.client.robot_command): a velocity command needs an end time, after which the robot stands; a command
  without the lease or without motor power raises an error.
- Stretch (stretch_body/base.py, robot.py): `set_velocity` takes effect at `push_command`; the wheels hold it; status is
  of the last cycle; `runstop_event` of the pimu and `in_guarded_event` of a wheel report a stop and a contact.
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsnbench.values.encoding.images import encode_jpeg
from vsnbench.values.pose import Pose, advanced

DEAD_TIME_S, LAG_S = 0.1, 0.1
"""Of a legged robot; docs/robots.md has values of real bases."""


class LateBase:
    """A base that follows its command after a dead time and with a lag; commands below its least do not move it."""

    def __init__(self, least_m_s: float = 0.0, least_rad_s: float = 0.0, dead_time_s: float = DEAD_TIME_S) -> None:
        self.at = Pose(0.3, -0.2, 2.9)
        self.time_s = 1000.0
        self.wanted = (0.0, 0.0)
        self._least, self._dead_time_s = (least_m_s, least_rad_s), dead_time_s
        self._queue: list[tuple[float, tuple[float, float]]] = []
        self._now = (0.0, 0.0)

    def command(self, forward_m_s: float, turn_rad_s: float) -> None:
        moving = (forward_m_s, turn_rad_s)
        taken = tuple(v if abs(v) >= least else 0.0 for v, least in zip(moving, self._least, strict=True))
        self.wanted = (taken[0], taken[1])
        self._queue.append((self.time_s + self._dead_time_s, self.wanted))

    def advance(self, duration_s: float) -> None:
        step_s = 0.005
        for _ in range(max(1, round(duration_s / step_s))):
            self.time_s += step_s
            due = [velocity for due_s, velocity in self._queue if due_s <= self.time_s]
            if due:
                self._target = due[-1]
                self._queue = [item for item in self._queue if item[0] > self.time_s]
            target = getattr(self, "_target", (0.0, 0.0))
            share = step_s / LAG_S
            self._now = tuple(a + share * (b - a) for a, b in zip(self._now, target, strict=True))  # type: ignore[assignment]
            self.at = advanced(self.at, self._now[0] * step_s, self._now[1] * step_s)

    @property
    def pose(self) -> tuple[float, float, float]:
        return self.at.x_m, self.at.y_m, math.remainder(self.at.heading_rad, math.tau)


class SportSdk:
    """`SportClient` and `VideoClient` of a Go2, and its state topic."""

    def __init__(self, base: LateBase) -> None:
        self._base = base
        self.code = 0
        self.silent = False
        self.stops = 0

    def Move(self, vx: float, vy: float, vyaw: float) -> int:  # noqa: N802
        assert vy == 0.0
        if self.code == 0:
            self._base.command(vx, vyaw)
        return self.code

    def StopMove(self) -> int:  # noqa: N802
        self.stops += 1
        self._base.command(0.0, 0.0)
        return 0

    def GetImageSample(self) -> tuple[int, list[int]]:  # noqa: N802
        return 0, list(encode_jpeg(np.full((48, 64, 3), 90, np.uint8)))

    def subscribe(self, take: Any) -> None:
        self.take = take
        self.publish()

    def publish(self) -> None:
        if not self.silent:
            x, y, heading = self._base.pose
            self.take(SimpleNamespace(position=[x, y, 0.31], imu_state=SimpleNamespace(rpy=[0.01, -0.02, heading])))


class SpotError(Exception):
    """As bosdyn.client.exceptions.Error."""


class SpotSdk:
    """The functions of spot._sdk."""

    def __init__(self, base: LateBase) -> None:
        self._base = base
        self.ends_s = 0.0
        self.owner = ""

    def functions(self) -> dict[str, Any]:
        return {
            "state": self.state,
            "command": self.command,
            "stop": self.stop,
            "errors": (SpotError,),
            "colours": lambda: {"encoding": "raw", "height": 48, "width": 64, "data": bytes(48 * 64 * 3)},
            "depth": lambda: (
                {"encoding": "mm16", "height": 48, "width": 64, "data": np.full((48, 64), 2000, "<u2").tobytes()},
                self._base.time_s,
            ),
        }

    def state(self) -> dict[str, Any]:
        return {"pose": self._base.pose, "stamp_s": self._base.time_s, "battery": 0.8, "owner": self.owner}

    def command(self, forward_m_s: float, turn_rad_s: float, expires_s: float) -> None:
        if self.owner:
            raise SpotError("LeaseUseError")
        self._base.command(forward_m_s, turn_rad_s)
        self.ends_s = self._base.time_s + expires_s

    def stop(self) -> None:
        if self.owner:
            raise SpotError("LeaseUseError")
        self._base.command(0.0, 0.0)

    def advance(self, duration_s: float) -> None:
        if self._base.time_s > self.ends_s:
            self._base.command(0.0, 0.0)
        self._base.advance(duration_s)


class StretchRobot:
    """`stretch_body.robot.Robot`, with the parts that the example uses."""

    def __init__(self, base: LateBase) -> None:
        self._base = base
        self._waiting = (0.0, 0.0)
        self.pimu = SimpleNamespace(status={"runstop_event": False, "voltage": 12.4})
        wheels = {"left_wheel": self._wheel(), "right_wheel": self._wheel()}
        self.base = SimpleNamespace(status={}, set_velocity=self._set, **wheels)
        self.pull()

    @staticmethod
    def _wheel() -> Any:
        return SimpleNamespace(status={"in_guarded_event": False})

    def _set(self, v_m: float, w_r: float) -> None:
        self._waiting = (v_m, w_r)

    def push_command(self) -> None:
        self._base.command(*self._waiting)

    def pull(self) -> None:
        x, y, heading = self._base.pose
        self.base.status.update(x=x, y=y, theta=heading, timestamp_pc=self._base.time_s)
