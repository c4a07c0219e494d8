"""Alignment of a scan: finds its floor, levels it, applies the scale and turns walls to the axes."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsnbench.errors import SiteError
from vsnbench.simulator.rendering.scan.mesh import ScanMesh

UP_AXES: Final = {
    "x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "y": (0, 1, 0),
    "-y": (0, -1, 0),
    "z": (0, 0, 1),
    "-z": (0, 0, -1),
}
LENGTH_UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres of each unit."""
_STEEPEST: Final = math.cos(math.radians(20))
"""Cosine of the largest angle between the up axis and the normal of the floor's faces before it is levelled."""
_LEVEL: Final = math.cos(math.radians(8))
_UPRIGHT: Final = 0.2
_BIN_M: Final = 0.02
_FLOOR_M: Final = 0.06
"""Distance from the plane within which a face belongs to the floor."""
_LEAST_FLOOR_M2: Final = 1.5
_LEAST_SHARE: Final = 0.1
"""Minimum share of the floor in all surfaces that face up."""
_STOREY_M: Final = 1.9
"""Minimum height of a second storey's floor above the first one."""
_STOREY_SHARE: Final = 0.35
_HEIGHTS_M: Final = (1.0, 8.0)
_WIDTHS_M: Final = (1.0, 80.0)
_MARGIN, _MARGIN_M = 0.1, 2.0
_FURNITURE_M: Final = (0.25, 1.3)

Floats = npt.NDArray[np.float64]


def align_scan(mesh: ScanMesh, up: str, metres_per_unit: float) -> tuple[ScanMesh, Floats]:
    """Return a scan in metres on a level floor at z = 0, its walls parallel to the axes, its lower left corner at 0.

    Args:
        mesh: the scan as its file has it.
        up: the axis of the file that points up, a key of `UP_AXES`.
        metres_per_unit: scale.

    Returns:
        The aligned scan, and the (4, 4) transformation from the file's coordinates to the site's frame.

    Raises:
        SiteError: the scan has no floor (`scan-no-floor`), is upside down (`scan-upside-down`), has an implausible size
            (`scan-scale`) or several storeys (`scan-storeys`).
    """
    vertices = mesh.vertices.astype(np.float64) * metres_per_unit
    low, high = np.percentile(vertices, 1, axis=0), np.percentile(vertices, 99, axis=0)
    _check_size(high - low, UP_AXES[up])
    margin_m = _MARGIN_M + _MARGIN * (high - low)
    # Single triangles far away are faults of a scan; they would make every grid too large.
    is_near = np.asarray(((vertices > low - margin_m) & (vertices < high + margin_m)).all(axis=1))
    near = is_near[mesh.faces].all(axis=1)
    vertices = np.clip(vertices, low - margin_m, high + margin_m)
    values = {name: getattr(mesh, name)[near] for name in ("faces", "texture", "uv")}
    corners = vertices[values["faces"]]
    rotation = _from_to(np.array(UP_AXES[up], float), np.array([0.0, 0.0, 1.0]))
    middles, normals, areas = _faces(corners)
    rotation, height_m = _level(middles, normals, areas, rotation, up)
    turned = normals @ rotation.T
    _check_way_up(middles @ rotation.T, turned, areas, height_m, up)
    yaw_rad = _wall_direction(turned, areas)
    cos, sin = math.cos(-yaw_rad), math.sin(-yaw_rad)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    placed = vertices @ rotation.T
    shift = -np.array([*_lower_left(placed, height_m), height_m])
    transformation = np.eye(4)
    transformation[:3, :3], transformation[:3, 3] = rotation * metres_per_unit, shift
    aligned = np.round(placed + shift, 5).astype(np.float32)
    splats = mesh.splats
    if splats is not None:
        places = splats.centres * metres_per_unit
        inside = np.asarray(((places > low - margin_m) & (places < high + margin_m)).all(axis=1))
        splats = splats.chosen(inside)
        splats = splats.moved(transformation[:3, :3], shift)
    scan = ScanMesh(aligned, colors=mesh.colors, textures=mesh.textures, splats=splats, **values)
    return scan, transformation


def _check_size(spread: Floats, up: tuple[int, int, int]) -> None:
    own = next(axis for axis, value in enumerate(up) if value)
    if _is_plausible(spread, own):
        return
    advice = "measure a length in the scan and in the room, and give both: --length 3.20=3.35"
    likely = [unit for unit, metres in LENGTH_UNITS.items() if _is_plausible(spread * metres, own)]
    if other := [name for axis, name in enumerate("xyz") if _is_plausible(spread, axis)]:
        advice = f"give the axis that points up: --up {other[-1]}, or --up -{other[-1]}"
    elif likely:
        advice = f"give --unit {likely[0]} if that is the scan's unit, or a measured length: --length 3200=3.20"
    high_m, wide_m = float(spread[own]), float(np.delete(spread, own).max())
    raise SiteError(f"the scan would be {wide_m:.4g} m wide and {high_m:.4g} m high", advice=advice, code="scan-scale")


def _is_plausible(spread: Floats, up: int) -> bool:
    """Whether a flat can have this size, metres along each axis, if `up` is the vertical one."""
    wide_m = float(np.delete(spread, up).max())
    return _HEIGHTS_M[0] <= spread[up] <= _HEIGHTS_M[1] and _WIDTHS_M[0] <= wide_m <= _WIDTHS_M[1]


def _faces(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Return middles (T, 3), unit normals (T, 3) and areas (T,)."""
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.sqrt((crossed * crossed).sum(axis=1))
    return corners.mean(axis=1), crossed / np.maximum(length, 1e-12)[:, None], length / 2


def _level(middles: Floats, normals: Floats, areas: Floats, rotation: Floats, up: str) -> tuple[Floats, float]:
    """Return the rotation that levels the floor, and the floor's height in the rotated frame."""
    for least in (_STEEPEST, _LEVEL, _LEVEL):
        facing = np.abs((normals @ rotation.T)[:, 2]) > least
        if not facing.any():
            break
        ways = (normals @ rotation.T)[facing]
        ways *= np.sign(ways[:, 2:])
        mean = (ways * areas[facing, None]).sum(axis=0)
        rotation = _from_to(mean / math.sqrt(float(mean @ mean)), np.array([0.0, 0.0, 1.0])) @ rotation
    turned, places = normals @ rotation.T, middles @ rotation.T
    level = turned[:, 2] > _LEVEL
    height_m = _floor_height(places[level, 2], areas[level], up)
    for _ in range(4):
        near = level & (np.abs(places[:, 2] - height_m) < _FLOOR_M)
        slope = _plane(places[near], areas[near])
        normal = np.array([-slope[0], -slope[1], 1.0])
        rotation = _from_to(normal / math.sqrt(float(normal @ normal)), np.array([0.0, 0.0, 1.0])) @ rotation
        places = middles @ rotation.T
        near = level & (np.abs(places[:, 2] - height_m) < _FLOOR_M)
        height_m = float(np.average(places[near, 2], weights=areas[near])) if near.any() else height_m
    return rotation, height_m


def _floor_height(heights_m: Floats, areas: Floats, up: str) -> float:
    """Return the height of the lowest large level surface.

    Raises:
        SiteError: there is none, or another one is a storey higher.
    """
    advice = f"give the axis that points up (--up; now {up}), or scan the floor as well"
    if not len(heights_m):
        raise SiteError("the scan has no level surface that could be a floor", advice=advice, code="scan-no-floor")
    lowest = float(heights_m.min())
    bins = np.bincount(((heights_m - lowest) / _BIN_M).astype(int), areas)
    window = np.convolve(bins, np.ones(7), "same")
    large = window >= max(_LEAST_FLOOR_M2, _LEAST_SHARE * float(areas.sum()), 0.4 * float(window.max()))
    if not large.any():
        raise SiteError(
            f"the scan has no floor: its largest level surface has {float(window.max()):.2g} m²",
            advice=advice,
            code="scan-no-floor",
        )
    first = int(np.argmax(large))
    peak = first + int(np.argmax(window[first : first + 8]))
    above = window[peak + round(_STOREY_M / _BIN_M) :]
    if above.size and float(above.max()) >= _STOREY_SHARE * float(window[peak]):
        higher_m = _STOREY_M + int(np.argmax(above)) * _BIN_M
        raise SiteError(
            f"the scan has two storeys: another floor is {higher_m:.1f} m above the lowest one",
            advice="cut it in the scanning app or in MeshLab, and import each storey as a site of its own",
            code="scan-storeys",
        )
    return lowest + (peak + 0.5) * _BIN_M


def _plane(points: Floats, weights: Floats) -> tuple[float, float]:
    """Return the slopes along x and y of the plane z = a + bx + cy with the least weighted squares."""
    if len(points) < 3:
        return 0.0, 0.0
    middle = np.average(points, axis=0, weights=weights)
    x, y, z = (points - middle).T
    xx, xy, yy = (float((weights * a * b).sum()) for a, b in ((x, x), (x, y), (y, y)))
    xz, yz = (float((weights * a * z).sum()) for a in (x, y))
    determinant = xx * yy - xy * xy
    if determinant <= 1e-9 * max(xx, yy) ** 2:
        return 0.0, 0.0
    return (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant


def _check_way_up(places: Floats, normals: Floats, areas: Floats, floor_m: float, up: str) -> None:
    """Compare the tops of furniture above the floor with undersides as far below the ceiling."""
    facing_down = normals[:, 2] < -_LEVEL
    if not facing_down.any():
        return
    above_m = places[:, 2] - floor_m
    ceiling_m = float(np.percentile(above_m[facing_down], 95))
    low, high = _FURNITURE_M
    tops = areas[(normals[:, 2] > _LEVEL) & (above_m > low) & (above_m < high)].sum()
    hanging = areas[facing_down & (ceiling_m - above_m > low) & (ceiling_m - above_m < high)].sum()
    if ceiling_m > 1.8 and hanging > 0.3 and hanging > 2.5 * tops:
        other = up.removeprefix("-") if up.startswith("-") else f"-{up}"
        raise SiteError(
            "the scan is upside down: level surfaces hang below its ceiling and none stand on its floor",
            advice=f"give --up {other}",
            code="scan-upside-down",
        )


def _wall_direction(normals: Floats, areas: Floats) -> float:
    """Return the direction of most walls modulo a right angle, radians in -pi/4 to pi/4."""
    upright = np.abs(normals[:, 2]) < _UPRIGHT
    angle, weight = 4 * np.arctan2(normals[upright, 1], normals[upright, 0]), areas[upright]
    if not weight.size:
        return 0.0
    bins = np.bincount(((angle + math.pi) / math.tau * 180).astype(int) % 180, weight, 180)
    smooth = sum(np.roll(bins, step) for step in range(-4, 5))
    about = (int(np.argmax(smooth)) + 0.5) / 180 * math.tau - math.pi
    for within in (0.6, 0.3, 0.3):
        off = (angle - about + math.pi) % math.tau - math.pi
        near = np.abs(off) < within
        about += float((off[near] * weight[near]).sum() / max(float(weight[near].sum()), 1e-12))
    return math.remainder(about, math.tau) / 4


def _lower_left(places: Floats, floor_m: float) -> list[float]:
    """Return the lower left corner of what is between floor and ceiling, without single points far away."""
    inside = np.abs(places[:, 2] - floor_m - 1.0) < 1.2
    return [float(value) for value in np.percentile(places[inside, :2] if inside.any() else places[:, :2], 0.2, axis=0)]


def _from_to(source: Floats, target: Floats) -> Floats:
    """Return the rotation (3, 3) that takes one unit vector to another by the shortest way."""
    cos = float(source @ target)
    if cos < -0.999999:
        side = np.array([1.0, 0.0, 0.0]) if abs(source[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        across = np.cross(source, side)
        across /= math.sqrt(float(across @ across))
        return np.asarray(2 * np.outer(across, across) - np.eye(3))
    x, y, z = np.cross(source, target).tolist()
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + cos))
