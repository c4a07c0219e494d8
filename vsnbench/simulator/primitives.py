"""Primitives from which both physics and rasterizer build their worlds."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from vsnbench.sites.scan import SiteScan
from vsnbench.sites.site import SiteObject

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Shape(StrEnum):
    """Kind of primitive; all are centred on their origin and aligned with their own axes."""

    BOX = "box"
    CYLINDER = "cylinder"
    """Along its own z axis; half sizes are (radius, radius, half length)."""
    ELLIPSOID = "ellipsoid"
    LEAF = "leaf"
    """A pointed lens along its own x axis with a ridge on both sides; physics and shadows use its ellipsoid."""


@dataclass(frozen=True, slots=True)
class Material:
    """A colour and a procedural texture."""

    color: Vector
    """sRGB in [0, 1]."""
    texture: str = "plain"
    """Name of a procedural texture in `textures.TEXTURES` (plain, wood, planks, tiles, fabric, ...)."""
    shininess: float = 0.0
    """0 matt to 1 mirror-like; with depth noise, shiny and dark surfaces lose depth."""
    glow: float = 0.0
    """Share of the colour that it emits, 0 to 1: lamp shades, screens."""


@dataclass(frozen=True, slots=True)
class Primitive:
    """A shape in the site's frame; the parts of furniture are in its own frame until they are placed."""

    shape: Shape
    centre: Vector
    half_size: Vector
    material: Material
    rotation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Unit quaternion (w, x, y, z)."""
    category: str = ""
    """Object category, or `wall`, `floor`, `ceiling`, `door`, `window`."""
    instance: int = 0
    """1 + index of the object in `Site.objects`; 0 for the building itself."""
    solid: bool = True
    """Whether a robot can touch it."""
    visible: bool = True
    """Whether the camera sees it; the outline of a surveyed footprint is solid but not visible."""
    taper: float = 1.0
    """Width of a box or cylinder at its bottom relative to its top; physics and shadows use the untapered shape."""
    bevel_m: float = 0.0
    """Width of the bevel on a box's edges; physics and shadows use the box."""


@dataclass(frozen=True, slots=True)
class Scene:
    """A site as primitives."""

    primitives: tuple[Primitive, ...]
    bounds: tuple[float, float, float, float]
    """(x_min, y_min, x_max, y_max) of the floor plan, metres."""
    ceiling_height_m: float
    scan: SiteScan | None = None
    """What the camera sees instead of the visible primitives."""
    objects: tuple[SiteObject, ...] = ()
    """The surveyed objects, which label the pixels of a scan; empty without one."""

    def shininess(self, objects: int) -> npt.NDArray[np.float32]:
        """Return the largest shininess of the parts of each instance (objects + 1,); 0 for the building."""
        shininess = np.zeros(objects + 1, np.float32)
        for part in self.primitives:
            if part.instance and part.visible:
                shininess[part.instance] = max(shininess[part.instance], part.material.shininess)
        return shininess
