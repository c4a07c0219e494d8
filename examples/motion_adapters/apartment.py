"""A simulated base in the apartment, as a `Base`: what a robot's SDK is to an adapter. Time passes only in motion."""

import math
import time
from pathlib import Path

import numpy as np
from by_velocity import PERIOD_S, Base

from vsnbench import Pose, load_profile
from vsnbench.control.command import Command
from vsnbench.simulator.dynamics.physics import simulator_version
from vsnbench.simulator.dynamics.simulated_base import SimulatedBase
from vsnbench.simulator.rendering.renderer import Renderer
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import load_site
from vsnbench.values.robot_identity import SimulationAccount


class Apartment(Base):
    """The stand-in for a robot; `real_time` makes motion take as long as on a robot."""

    gone_s = 10.0  # nothing moves while it waits

    def __init__(self, profile: str = "simulated_base.yaml", site: str = "apartment", real_time: str = "") -> None:
        found = Path(__file__).with_name(profile)
        self.profile, self.site = load_profile(found if found.is_file() else profile), load_site(site)
        scene = build_scene(self.site)
        self._base, self._renderer = SimulatedBase(self.site, scene, self.profile), Renderer(scene)
        self._real_time, self._touched, self._pose = bool(real_time), "", Pose(0.0, 0.0)
        self.state(with_depth=True)  # compiles
        self.colours()
        account = SimulationAccount(
            simulator=simulator_version(),
            site=self.site.name,
            site_sha256=self.site.sha256,
            profile_sha256=self.profile.sha256,
            odometry_rate_hz=1 / PERIOD_S,
            rate_factor=1,
        )
        self.card = {
            "name": "apartment",
            "version": "1",
            "movements": ["move", "waypoint", "trajectory", "velocity"],
            "sensors": ["rgb", "depth"],
            "simulation": account.model_dump(mode="json", by_alias=True),
        }

    @property
    def now_s(self) -> float:
        return self._base.now_s

    @property
    def pose(self) -> tuple[float, float, float]:
        pose = self._base.odometry
        return pose.x_m, pose.y_m, math.remainder(pose.heading_rad, math.tau)

    def send(self, forward_m_s: float, turn_rad_s: float) -> str:
        self._base.set_command(Command(forward_m_s, turn_rad_s))
        if self._real_time:
            time.sleep(PERIOD_S)
        touched = self._base.advance()
        return "collision" if touched else ""

    def stop(self) -> None:
        self._base.set_command(Command(0.0, 0.0))

    def place(self, pose: list[float], seed: int) -> str:
        return self._base.put_down(Pose(*pose), seed)

    def state(self, *, with_depth: bool = False) -> dict:
        truth, state = self._base.pose, {"pose": list(self.pose), "stamp_s": self.now_s}
        state["truth"] = [truth.x_m, truth.y_m, truth.heading_rad]
        if with_depth:
            depth_m = self._renderer.measure(self.profile.camera, truth)
            depth_m[depth_m < self.profile.camera.depth_min_m] = np.nan
            state["depth"] = {"encoding": "f32", "height": depth_m.shape[0], "width": depth_m.shape[1]}
            state["depth"]["data"] = depth_m.astype("<f4").tobytes()
        return state

    def colours(self) -> dict:
        rgb = self._renderer.look(self.profile.camera, self._base.pose).rgb
        return {"encoding": "raw", "height": rgb.shape[0], "width": rgb.shape[1], "data": rgb.tobytes()}
