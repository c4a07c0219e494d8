"""The cameras of a simulated robot: colours, depth and labels, with noise and motion blur."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsnbench.sensing.images.rectifier import levelled
from vsnbench.simulator.dynamics.driven_base import DrivenBase
from vsnbench.simulator.dynamics.noise import NoiseSettings, noisy_depth
from vsnbench.simulator.primitives import Scene
from vsnbench.simulator.rendering.exposure import exposed
from vsnbench.simulator.rendering.renderer import Frame, Renderer
from vsnbench.simulator.rendering.shading import mark_out_of_range
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.observation import InstanceImage, Observation, Sensor, observation_of, with_changes
from vsnbench.values.pose import LEVEL, Pose
from vsnbench.values.robot_profile import RobotProfile

SIMULATED_SENSORS: Final = frozenset({Sensor.RGB, Sensor.DEPTH, Sensor.ODOMETRY, Sensor.INSTANCES})
"""Sensors of a simulated robot."""


class SimulatedCamera:
    """Renders what the cameras on a base see now.

    Args:
        scene: the scene of `site`.
        site: the site.
        profile: the robot's profile.
        base: the base that carries it.
        noise: noise of the sensors; None for none.
        read: sensors that are used. Colours and labels are rendered only if they are, or if noise depends on them.
    """

    def __init__(
        self,
        scene: Scene,
        site: Site,
        profile: RobotProfile,
        base: DrivenBase,
        noise: NoiseSettings | None,
        read: frozenset[Sensor],
    ) -> None:
        self._base = base
        self._noise = noise
        self._camera = profile.camera.without_roll
        self._further = {role: profile.cameras[role].without_roll for role in sorted(profile.cameras)}
        self._knows_attitude = getattr(profile.interface, "attitude", None) is not None
        self._draws_labels = Sensor.INSTANCES in read or noise is not None
        self._draws_colours = self._draws_labels or Sensor.RGB in read
        self._renderer = Renderer(scene)
        self._shininess = scene.shininess(len(site.objects))
        self._categories = {number: thing.category for number, thing in enumerate(site.objects, start=1)}
        base.keep_trail(max(camera.exposure_s for camera in (profile.camera, *profile.cameras.values())))

    def begin(self, depth_seed: np.random.SeedSequence, other_depth_seed: np.random.SeedSequence) -> None:
        """Start an episode: the noise follows from the seeds, the second that of cameras that are mounted otherwise."""
        self._depth_rng = np.random.default_rng(depth_seed)
        self._other_depth_rng = np.random.default_rng(other_depth_seed)
        seeds = depth_seed.spawn(len(self._further))
        self._further_rng = {role: np.random.default_rng(seed) for role, seed in zip(self._further, seeds, strict=True)}

    def observe(self, pose: Pose, other: Camera | None = None) -> Observation:
        """Return the images of now, with the odometry; those of another camera have noise of their own."""
        if other is None:
            main = self._view(self._camera, pose, self._depth_rng)
        else:
            main = self._view(other.without_roll, pose, self._other_depth_rng)
        if not self._further:
            return main
        further = {role: self._view(camera, pose, self._further_rng[role]) for role, camera in self._further.items()}
        return with_changes(main, cameras=further)

    def frame(self) -> npt.NDArray[np.uint8] | None:
        """Return the colours of now (H, W, 3), without an effect on later images; None if they are not rendered."""
        if not self._draws_colours:
            return None
        return self._view(self._camera, Pose(0.0, 0.0), np.random.default_rng(0)).rgb

    def measure(self) -> tuple[npt.NDArray[np.float32], Camera]:
        """Return only the depth of now (H, W), metres, NaN where invalid, and its camera."""
        camera, pose, attitude = self._camera, self._base.physics.pose, self._base.attitude
        if self._noise is None:
            depth_m = self._renderer.measure(camera, pose, attitude)
        else:
            depth_m = self._with_noise(self._renderer.render(camera, pose, attitude), self._depth_rng)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        rectifier, camera = levelled(camera, attitude if self._knows_attitude else LEVEL)
        return depth_m if rectifier is None else rectifier.depth(depth_m), camera

    def _view(self, camera: Camera, pose: Pose, depth_rng: np.random.Generator) -> Observation:
        here, attitude = self._base.physics.pose, self._base.attitude
        colours: dict[str, Any] = {}
        if self._draws_colours:
            view = (self._renderer.render if self._draws_labels else self._renderer.look)(camera, here, attitude)
            depth_m = view.depth_m
            colours = {"rgb": exposed(view.rgb, camera, self._renderer, self._base.seen), "instances": None}
            if isinstance(view, Frame):
                depth_m = self._with_noise(view, depth_rng)
                colours["instances"] = InstanceImage(view.instance, self._categories)
        else:
            depth_m = self._renderer.measure(camera, here, attitude)
        beyond_range = depth_m > np.float32(camera.depth_max_m)
        mark_out_of_range(depth_m, np.float32(camera.depth_min_m), np.float32(camera.depth_max_m))
        rectifier, camera = levelled(camera, attitude if self._knows_attitude else LEVEL)
        if rectifier is not None:
            depth_m, beyond_range = rectifier.depth(depth_m), rectifier.labels(beyond_range)
            if "rgb" in colours:
                colours["rgb"] = rectifier.image(colours["rgb"])
            if (labels := colours.get("instances")) is not None:
                colours["instances"] = InstanceImage(rectifier.labels(labels.ids), labels.categories)
        return observation_of(
            self._base.physics.time_s, camera, depth_m=depth_m, pose=pose, beyond_range=beyond_range, **colours
        )

    def _with_noise(self, view: Frame, rng: np.random.Generator) -> npt.NDArray[np.float32]:
        if self._noise is None:
            return view.depth_m
        return noisy_depth(view.depth_m, view.rgb, self._shininess[view.instance], self._noise.depth, rng)
