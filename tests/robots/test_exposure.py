"""Motion blur of simulated colours."""

import numpy as np
import numpy.typing as npt

from tests.robots.test_simulated_drive import ROOM
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.values.movement import Velocity
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose

EXPOSURE_S = 0.08


def looks(exposure_s: float, turning_rad_s: float) -> tuple[Observation, Observation]:
    """Return what a robot sees at rest, and what it sees while it turns."""
    profile = load_profile("turtlebot2")
    camera = profile.camera.model_copy(update={"width": 160, "height": 120, "exposure_s": exposure_s})
    robot = SimulatedRobot(ROOM, profile.model_copy(update={"camera": camera}), read=frozenset({Sensor.RGB}))
    robot.begin(ROOM.starts[0], 1)
    resting = robot.observe()
    robot.follow(Velocity(0.0, turning_rad_s, 2.0), None)
    robot.advance(1.0)
    return resting, robot.observe()


def sharpness(rgb: npt.NDArray[np.uint8]) -> float:
    return float(np.abs(np.diff(rgb.astype(float), axis=1)).mean())


def test_an_image_blurs_with_the_motion_during_its_exposure_and_only_then() -> None:
    sharp, blurred = looks(0.0, 0.5), looks(EXPOSURE_S, 0.5)
    assert np.array_equal(sharp[0].rgb, blurred[0].rgb), "at rest"
    assert sharpness(blurred[1].rgb) < 0.8 * sharpness(sharp[1].rgb)
    assert (sharp[1].pose, sharp[1].stamp_s) == (blurred[1].pose, blurred[1].stamp_s)
    assert sharp[1].depth_m is not None
    assert blurred[1].depth_m is not None
    assert np.array_equal(sharp[1].depth_m, blurred[1].depth_m, equal_nan=True)
    assert np.array_equal(blurred[1].rgb, looks(EXPOSURE_S, 0.5)[1].rgb)


def test_a_blurred_image_is_the_mean_of_views_from_where_the_camera_was() -> None:
    from vsnbench.simulator.rendering.renderer import Renderer
    from vsnbench.simulator.scene import build_scene

    seen = looks(EXPOSURE_S, 0.5)[1]
    renderer, turned_rad = Renderer(build_scene(ROOM)), EXPOSURE_S * 0.5
    headings = seen.pose.heading_rad - np.linspace(0.0, turned_rad, 20)
    views = [renderer.look(seen.camera, Pose(*seen.pose.position, float(heading))).rgb for heading in headings]
    assert np.abs(np.mean(views, axis=0) - seen.rgb).mean() < 2.0


def test_a_profile_without_an_exposure_keeps_its_hash() -> None:
    profile = load_profile("turtlebot2")
    assert "exposure_s" not in profile.content()["camera"]
    camera = profile.camera.model_copy(update={"exposure_s": 0.01})
    assert profile.model_copy(update={"camera": camera}).content()["camera"]["exposure_s"] == 0.01
