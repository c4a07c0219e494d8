"""A Unitree Go2 as a `Base`, by its sport API: `python socket_adapter.py go2:Go2 eth0`.

Needs unitree_sdk2py (github.com/unitreerobotics/unitree_sdk2_python) and the robot standing in sport mode. The front
camera has colours only: without depth there is no depth guard, and models that need depth cannot run. Give the profile
`tolerances: {position_m: 0.05, turn_deg: 3}`.
"""

import threading
import time

from by_velocity import PERIOD_S, Base

SILENT_S = 0.5


class Go2(Base):
    """Moves by `SportClient.Move`, which the robot executes until the next command: `stop` is essential.

    Args:
        network: interface to the robot.
        sdk: `SportClient`, `VideoClient` and a function that subscribes to rt/sportmodestate; by default the SDK's.
    """

    card = {"name": "go2-sport", "version": "1", "movements": ["move", "waypoint", "trajectory", "velocity"]}  # noqa: RUF012
    least_m_s, least_rad_s = 0.15, 0.25  # slower commands make it step on the spot: measure yours
    near_m, near_rad = 0.03, 0.03

    def __init__(self, network: str = "eth0", sdk: tuple | None = None) -> None:
        self._sport, self._video, subscribe = sdk or _sdk(network)
        self._state, self._heard_s, self._arrived = None, 0.0, threading.Event()
        subscribe(self._on_state)
        if not self._arrived.wait(5.0):
            raise SystemExit("no message on rt/sportmodestate: check the network interface")

    def _on_state(self, state) -> None:
        self._state, self._heard_s = state, self.now_s
        self._arrived.set()

    @property
    def now_s(self) -> float:
        return time.monotonic()

    @property
    def pose(self) -> tuple[float, float, float]:
        return self._state.position[0], self._state.position[1], self._state.imu_state.rpy[2]

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        if self._sport.Move(forward_m_s, 0.0, turn_rad_s) != 0:
            return "fault"
        self._wait()
        return "sensor" if self.now_s - self._heard_s > SILENT_S else ""

    def _wait(self) -> None:
        time.sleep(PERIOD_S)

    def stop(self) -> None:
        self._sport.StopMove()

    def state(self, *, with_depth: bool = False) -> dict:
        return {"pose": list(map(float, self.pose)), "stamp_s": self._heard_s}

    def colours(self) -> dict:
        code, data = self._video.GetImageSample()
        if code != 0:
            raise RuntimeError(f"GetImageSample failed with code {code}")
        height, width = _jpeg_size(bytes(data))
        return {"encoding": "jpeg", "height": height, "width": width, "data": bytes(data)}


def _jpeg_size(data: bytes) -> tuple[int, int]:
    """Return height and width of a JPEG, from its frame header."""
    at = 2
    while at + 9 < len(data):
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if 0xC0 <= marker <= 0xC2:
            return int.from_bytes(data[at + 5 : at + 7], "big"), int.from_bytes(data[at + 7 : at + 9], "big")
        at += 2 + length
    raise RuntimeError("the camera's image is not a JPEG")


def _sdk(network: str) -> tuple:
    from unitree_sdk2py.core.channel import ChannelFactoryInitialize, ChannelSubscriber
    from unitree_sdk2py.go2.sport.sport_client import SportClient
    from unitree_sdk2py.go2.video.video_client import VideoClient
    from unitree_sdk2py.idl.unitree_go.msg.dds_ import SportModeState_

    ChannelFactoryInitialize(0, network)
    clients = SportClient(), VideoClient()
    for client in clients:
        client.SetTimeout(3.0)
        client.Init()
    return *clients, lambda take: ChannelSubscriber("rt/sportmodestate", SportModeState_).Init(take, 10)
