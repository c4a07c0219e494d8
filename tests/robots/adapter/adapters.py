"""Motion adapters for tests: the example's server over a base without a simulator, and scripted ones."""

import math
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.server import serve

from tests.models.remote.servers import Answer, scripted_server
from vsnbench.robots.adapter.robot import AdapterRobot
from vsnbench.robots.profiles import load_profile
from vsnbench.sites.site import StartingPosition
from vsnbench.values.pose import Pose, advanced

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "motion_adapters"
sys.path.insert(0, str(EXAMPLES))

import by_velocity  # noqa: E402  # needs the path
import socket_adapter  # noqa: E402

WIDTH, HEIGHT = 64, 48
START = StartingPosition(number=1, position=(2.0, 3.0), heading_deg=90)
PROFILE = (EXAMPLES / "simulated_base.yaml").read_text(encoding="utf-8")


class PlaneBase(by_velocity.Base):
    """A base on an empty plane in virtual time: it follows every command exactly, and measures it."""

    gone_s = 30.0

    def __init__(self) -> None:
        self.card: dict[str, Any] = {
            "name": "plane",
            "movements": ["move", "waypoint", "trajectory", "velocity"],
            "sensors": ["rgb", "depth"],
        }
        self.at = Pose(5.0, -1.0, 3.0)
        self.time_s = 100.0
        self.reported: dict[str, Any] = {}
        self.word = ""
        self.stops = 0
        self.speed = (0.0, 0.0)
        self.slips = 1.0

    @property
    def now_s(self) -> float:
        return self.time_s

    @property
    def pose(self) -> tuple[float, float, float]:
        return self.at.x_m, self.at.y_m, math.remainder(self.at.heading_rad, math.tau)

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        self.speed = (forward_m_s, turn_rad_s)
        period_s = by_velocity.PERIOD_S
        self.at = advanced(self.at, forward_m_s * period_s * self.slips, turn_rad_s * period_s * self.slips)
        self.time_s += period_s
        return self.word

    def stop(self) -> None:
        self.speed, self.stops = (0.0, 0.0), self.stops + 1

    def state(self, *, with_depth: bool = False) -> dict[str, Any]:
        self.time_s += 0.001
        state = {"pose": list(self.pose), "stamp_s": self.time_s, **self.reported}
        if with_depth:
            data = np.full((HEIGHT, WIDTH), 3000, "<u2").tobytes()
            state["depth"] = {"encoding": "mm16", "height": HEIGHT, "width": WIDTH, "data": data}
        return state

    def colours(self) -> dict[str, Any]:
        return {"encoding": "raw", "height": HEIGHT, "width": WIDTH, "data": bytes(HEIGHT * WIDTH * 3)}


def write_profile(directory: Path, address: str, **changes: str) -> Path:
    """Write the example's profile with the small camera of these adapters."""
    text = PROFILE.replace("width: 640", f"width: {WIDTH}").replace("height: 480", f"height: {HEIGHT}")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = directory / "robot.yaml"
    path.write_text(text.replace("ws://127.0.0.1:8770", address), encoding="utf-8")
    return path


@contextmanager
def served(base: by_velocity.Base) -> Iterator[str]:
    """Serve a base with the example's adapter; yield its address."""

    def handle(connection: Any) -> None:
        socket_adapter.handle(connection, base)

    with serve(handle, "127.0.0.1", 0, compression=None, ping_interval=None, close_timeout=0.2) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()
        thread.join(5.0)


@contextmanager
def driven(base: by_velocity.Base, directory: Path) -> Iterator[AdapterRobot]:
    """Yield a robot behind the example's adapter, at the start of an episode."""
    with served(base) as address, AdapterRobot(load_profile(write_profile(directory, address))) as robot:
        robot.begin(START, 7)
        yield robot


STATE = {"pose": [0.0, 0.0, 0.0], "stamp_s": 1.0}
CARD = {"type": "card", "wire": 1, "card": {"name": "scripted", "sensors": ["rgb"]}}


@contextmanager
def scripted(
    on_drive: Answer, directory: Path, greeting: dict[str, Any] | bytes | None = None
) -> Iterator[AdapterRobot]:
    """Yield a robot behind an adapter that answers everything but `drive` properly."""

    def answer(connection: Any, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind in ("state", "begin"):
            reply(connection, message, "state" if kind == "state" else "ready", **STATE)
        else:
            on_drive(connection, message)

    with (
        scripted_server(answer, CARD if greeting is None else greeting) as address,
        AdapterRobot(load_profile(write_profile(directory, address))) as robot,
    ):
        robot.begin(START, 7)
        yield robot


def reply(connection: Any, message: dict[str, Any], kind: str, **content: Any) -> None:
    """Send an answer to a request."""
    connection.send(socket_adapter.packb({"type": kind, "seq": message["seq"], **content}))
