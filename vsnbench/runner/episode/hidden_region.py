"""A region of the depth image that stays invalid, however the robot turns.

An obstacle nearer than the camera's minimum range, a black sofa or a glass door hides a part of the image, too, and the
depth guard refuses forward moves. They stay where they are while the robot turns: other pixels show them then. A region
that stays in the image is a fault of the camera, or a part of the robot in its view.
"""

import math

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.depth_evidence import MIN_HIDDEN_CELLS, MIN_VALID_SHARE, Evidence
from vsnbench.sensing.images.regions import invalid_region
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose

MAX_HIDDEN_REFUSALS = 3
"""Number of forward moves refused for the same missing depth after which the camera is lost; a single look may fail."""
_ALL_SIDES_RAD = 1.5 * math.pi
"""Obstacles on three sides hide depth in half a circle of headings. A robot that has turned by three quarters of a
circle has looked to the side from which it came."""
_BETWEEN_LOOKS_RAD = math.radians(45)
"""More of a turn between two looks does not count: depth may be in the directions that it leaves out."""
_PROOF_RAD = math.radians(20)
"""Directions that lack depth in the region and have it elsewhere in the image; a lens 0.1 m ahead of the base's axis
sees the edge of an object at 0.6 m in directions that differ by up to 10°, and an object has two edges."""
_PROOF_SHARE = 1 / 3
"""Smallest share of the region's directions that have depth elsewhere: half after one turn by half the view."""
_SAME_PLACE_M = 0.1
"""Directions are compared between looks from within this distance."""
_BIN_RAD = math.radians(3)
_MEASURED = 0.5
"""Smallest share of valid pixels in a column whose direction has depth."""
_SAMPLES = 64
"""Sampled pixels per row."""


class HiddenRegion:
    """Follows the cells of the depth guard that had no depth in any look since the first of them."""

    def __init__(self) -> None:
        self._cells: npt.NDArray[np.bool_] = np.zeros(0, np.bool_)
        self._refusals = 0

    def look(self, observation: Observation, evidence: Evidence) -> None:
        """Take the depth image before an action."""
        assert observation.depth_m is not None  # noqa: S101  # the caller has evidence from it
        step = max(1, observation.depth_m.shape[1] // _SAMPLES)
        measured = observation.depth_m[::step, ::step] > 0
        if observation.beyond_range is not None:
            measured = measured | observation.beyond_range[::step, ::step]
        height, width = measured.shape
        rays = observation.camera.rays(width, height)
        # Rows of the floor: far walls above it may be out of range in every direction.
        share = measured[min(evidence.first_row // step, height - 1) :].mean(axis=0)
        blind = share < MIN_VALID_SHARE
        cells = self._cells & evidence.hidden if self._cells.shape == evidence.hidden.shape else evidence.hidden
        if np.count_nonzero(cells) < MIN_HIDDEN_CELLS or self._cells.size == 0:
            self._refusals = 0
            self._cells, self._unmeasured, self._columns = evidence.hidden, ~measured, blind
            self._heading_rad = observation.pose.heading_rad
            self._turned_rad = self._least_rad = self._most_rad = 0.0
            self._begin_place(observation.pose)
        else:
            self._cells, self._unmeasured, self._columns = cells, self._unmeasured & ~measured, self._columns & blind
            turn_rad = math.remainder(observation.pose.heading_rad - self._heading_rad, math.tau)
            self._heading_rad += turn_rad
            self._turned_rad += min(max(turn_rad, -_BETWEEN_LOOKS_RAD), _BETWEEN_LOOKS_RAD)
            self._least_rad = min(self._least_rad, self._turned_rad)
            self._most_rad = max(self._most_rad, self._turned_rad)
        if observation.pose.distance_to(self._place) > _SAME_PLACE_M:
            self._begin_place(observation.pose)
        self._azimuths_rad = np.arctan2(rays.left, rays.ahead[height // 2])
        self._headings_rad.append(self._heading_rad)
        self._measured |= _bins(self._heading_rad + self._azimuths_rad[share >= _MEASURED])

    def refused(self) -> str:
        """Register that the guard refused a move for missing depth; return the fault of the camera, or nothing."""
        self._refusals += 1
        if self._refusals < MAX_HIDDEN_REFUSALS or np.count_nonzero(self._cells) < MIN_HIDDEN_CELLS:
            return ""
        turned_rad = self._most_rad - self._least_rad
        if turned_rad < _ALL_SIDES_RAD and not self._has_depth_elsewhere():
            return ""
        region, turned_deg = invalid_region(self._unmeasured).text, math.degrees(turned_rad)
        return (
            f"{region} is always invalid, over a turn of {turned_deg:.0f}°: {self._refusals} forward moves were "
            "refused for it"
        )

    def _begin_place(self, place: Pose) -> None:
        self._place = place
        self._headings_rad: list[float] = []
        self._measured: set[int] = set()

    def _has_depth_elsewhere(self) -> bool:
        """Whether directions in which the region has no depth have depth in other columns of other looks."""
        hidden: set[int] = set()
        for heading_rad in self._headings_rad:
            hidden |= _bins(heading_rad + self._azimuths_rad[self._columns])
        both = len(hidden & self._measured)
        return both * _BIN_RAD >= _PROOF_RAD and both >= _PROOF_SHARE * len(hidden)


def _bins(directions_rad: npt.NDArray[np.float64]) -> set[int]:
    """Return the numbers of directions, in steps of a full circle."""
    return set((np.floor(directions_rad / _BIN_RAD).astype(int) % round(math.tau / _BIN_RAD)).tolist())
