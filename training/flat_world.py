"""Simulation of a generated flat without physics: exact lattice moves and small images."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from training.expert import UNREACHED, Lattice
from training.explorer import Search, Survey
from training.recipe import Recipe
from training.shards import BANDS, STRIPS
from vsnbench.models.pirlnav.policy import GOALS
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.generated_sites.generate import generate_site
from vsnbench.simulator.rendering.renderer import Renderer, eye_of
from vsnbench.simulator.scene import build_scene
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """One image, its labels and its visible objects."""

    rgb: npt.NDArray[np.uint8]
    labels: npt.NDArray[np.float16]
    """(LABELS,) labels, see `Shard.views`."""
    in_view: frozenset[int]
    """Indices of the site's objects that are large enough in the image to be recognized."""


@dataclass(frozen=True, slots=True)
class Lighting:
    """Lighting and camera settings that change a finished image."""

    exposure: float
    white_balance: tuple[float, float, float]
    gamma: float

    @classmethod
    def of(cls, seed: int) -> "Lighting":
        """Return the lighting of a seed: from dusk to noon, from lamp light to an overcast sky."""
        rng = np.random.default_rng([seed, 0x11])
        warmth = float(rng.uniform(-0.12, 0.12))
        tint = float(rng.uniform(-0.03, 0.03))
        return cls(float(rng.uniform(0.65, 1.25)), (1 + warmth, 1 + tint, 1 - warmth), float(rng.uniform(0.85, 1.2)))

    def apply(self, rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """Return the image (H, W, 3) uint8 with this lighting."""
        levels = np.linspace(0.0, 1.0, 256)
        tables = [np.clip(self.exposure * gain * levels**self.gamma, 0, 1) * 255 for gain in self.white_balance]
        lit = np.empty_like(rgb)
        for channel, table in enumerate(tables):
            lit[..., channel] = np.rint(table).astype(np.uint8)[rgb[..., channel]]
        return lit


class FlatWorld:
    """A generated flat with one camera and one lighting."""

    def __init__(self, recipe: Recipe, seed: int) -> None:
        plan, profile = recipe.demonstrations, load_profile(recipe.profile)
        self.site: Site = generate_site(seed)
        self.size_px = recipe.network.image_size_px
        self.camera: Camera = plan.varied(profile.camera, seed)
        self._light = Lighting.of(seed)
        self._renderer = Renderer(build_scene(self.site))
        self._space = free_space(self.site, profile.base.radius_m)
        rng = np.random.default_rng([recipe.seed, seed, 0])
        self.lattice = Lattice(self._space, float(rng.uniform(-math.pi, math.pi)))
        self._survey = Survey(self.lattice, self.camera.mount_height_m)
        self._starts: dict[str, npt.NDArray[np.int32]] = {}
        # The image is a centre crop of the camera's image, as in the network's preprocessing.
        self._focal_px = self.camera.focal_px * self.size_px / min(self.camera.width, self.camera.height)

        self._half_view_rad = _SURELY_IN_VIEW * math.atan(self.size_px / 2 / self._focal_px)
        strip = np.arange(self.size_px) * STRIPS // self.size_px
        self._strip_of_pixel = np.broadcast_to(strip, (self.size_px, self.size_px)).ravel()

    def search(self, goal: str) -> Search:
        """Return the demonstrator at the start of an episode."""
        return Search(self._survey, self._instances(goal), self._half_view_rad)

    def _instances(self, goal: str) -> frozenset[int]:
        return frozenset(number for number, thing in enumerate(self.site.objects) if thing.category == goal)

    def draw_start(self, goal: str, rng: np.random.Generator) -> Pose:
        """Return a free pose from which the goal is reachable and not yet reached."""
        space = self._space
        if goal not in self._starts:
            guides = [self._survey.guide_to_thing(number) for number in sorted(self._instances(goal))]
            ticks = np.minimum.reduce([guide.ticks for guide in guides])
            self._starts[goal] = np.flatnonzero((ticks > 0) & (ticks < UNREACHED)).astype(np.int32)
        drawn = int(rng.choice(self._starts[goal]))
        k, row, column = (int(part) for part in np.unravel_index(drawn, self.lattice.may_move.shape))
        return Pose(float(space.x_m[row, column]), float(space.y_m[row, column]), self.lattice.planner.heading_rad(k))

    def look(self, pose: Pose) -> View:
        """Return the image at a pose."""
        frame = self._renderer.render_from(eye_of(self.camera, pose), self.size_px, self.size_px, self._focal_px)
        pixels = np.bincount(frame.instance.ravel(), minlength=len(self.site.objects) + 1)[1:]
        in_view = frozenset(np.flatnonzero(pixels >= _SHOWN_SHARE * frame.instance.size).tolist())
        return View(self._light.apply(frame.rgb), self._labels(frame.instance, frame.depth_m), in_view)

    def goal_distance_m(self, goal: str, pose: Pose) -> float:
        """Return the distance to the footprint of the nearest instance."""
        from shapely.geometry import Point

        here = Point(pose.position)
        return min(float(thing.shape.distance(here)) for thing in self.site.instances(goal))

    @cached_property
    def _goal_of(self) -> npt.NDArray[np.int64]:
        """By instance id: 1 + index of the goal, 0 for other objects."""
        numbers = [1 + GOALS[thing.category] if thing.category in GOALS else 0 for thing in self.site.objects]
        return np.array([0, *numbers])

    def _labels(self, instance: npt.NDArray[np.int32], depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float16]:
        goal = self._goal_of[instance]
        kinds = len(GOALS) + 1
        counts = np.bincount(goal.ravel() + kinds * self._strip_of_pixel, minlength=kinds * STRIPS)
        shares = counts.reshape(STRIPS, kinds).T[1:] * (STRIPS / goal.size)
        share = shares.mean(axis=1)
        near = np.zeros(len(GOALS))
        for number in np.flatnonzero(share > 0.002):
            near[number] = 1 / (1 + _low(depth_m[goal == number + 1], 0.1))
        middle = depth_m[depth_m.shape[0] // 3 :]
        ahead = [1 / (1 + _low(band.ravel(), 0.05)) for band in np.array_split(middle, BANDS, axis=1)]
        return np.concatenate([np.sqrt(shares).ravel(), near, ahead]).astype(np.float16)


_SHOWN_SHARE = 0.005
"""Minimum share of the image of a found object."""
_SURELY_IN_VIEW = 0.85
"""Central share of the field of view in which a patch counts as seen."""


def _low(depth_m: npt.NDArray[np.float32], share: float) -> float:
    """Return the depth below which a `share` of the pixels are."""
    k = int(share * (len(depth_m) - 1))
    return float(np.partition(depth_m, k)[k])


SUCCESS_DISTANCE_M = ProtocolParameters().success_distance_m
