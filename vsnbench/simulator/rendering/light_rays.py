"""Compiled kernels of the lighting: rays against primitives, and the light at a point.

Rays are used only to prepare a scene; images are drawn by `raster`.
"""

from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled

_FAR = 1e30
_SKIN_M = 2e-3
"""Distance of a ray's origin from its surface, metres."""


@compiled
def _enter_slab(o: Any, d: Any, half: Any, low: Any, high: Any) -> Any:
    """Clip the interval (low, high) of a ray to the space between two planes."""
    if abs(d) < 1e-12:
        return (low, high) if abs(o) <= half else (1.0, 0.0)
    first, second = (-half - o) / d, (half - o) / d
    return max(low, min(first, second)), min(high, max(first, second))


@compiled
def _enter(  # noqa: PLR0913 - compiled functions take arrays, not objects
    shape: Any, hx: Any, hy: Any, hz: Any, ox: Any, oy: Any, oz: Any, dx: Any, dy: Any, dz: Any, limit: Any
) -> Any:
    """Return the distance at which a ray, in the primitive's frame, enters it, or _FAR; 0 if it starts inside."""
    if shape == 2:
        ox, oy, oz, dx, dy, dz = ox / hx, oy / hy, oz / hz, dx / hx, dy / hy, dz / hz
        a, b, c = dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0
        if c < 0.0:
            return 0.0
        root = b * b - a * c
        if b > 0.0 or root < 0.0:
            return _FAR
        at = (-b - np.sqrt(root)) / a
        return at if at < limit else _FAR
    low, high = _enter_slab(oz, dz, hz, 0.0, limit)
    if low > high:
        return _FAR
    if shape == 0:
        low, high = _enter_slab(ox, dx, hx, low, high)
        if low > high:
            return _FAR
        low, high = _enter_slab(oy, dy, hy, low, high)
        return low if low <= high else _FAR
    a, b, c = dx * dx + dy * dy, ox * dx + oy * dy, ox * ox + oy * oy - hx * hx
    if a < 1e-12:
        return low if c <= 0.0 else _FAR
    root = b * b - a * c
    if root < 0.0:
        return _FAR
    root = np.sqrt(root)
    low, high = max(low, (-b - root) / a), min(high, (-b + root) / a)
    return low if low <= high else _FAR


@compiled
def cast(  # noqa: PLR0913 - compiled functions take arrays, not objects
    px: Any,
    py: Any,
    pz: Any,
    rx: Any,
    ry: Any,
    rz: Any,
    limit: Any,
    enough: Any,
    skip: Any,
    skip_instance: Any,
    world: Any,
    stamps: Any,
) -> Any:
    """Return (distance, primitive) of the first occluder on a ray, or of any nearer than `enough`; (limit, -1) if free.

    `enough` is 0 for the first, and `limit` for any. `stamps` has the number of the last ray tested against each
    primitive; its last item is the number of this ray. Callers pass no literal integers or truths: this function would
    be compiled again for each type of literal.
    """
    grid_x, grid_y, cell, cell_start, cell_items, centres, rotations, half_sizes, shapes, radii, instances = world
    rows, columns = cell_start.shape[0], cell_start.shape[1] - 1
    stamps[-1] += 1
    stamp = stamps[-1]
    best, found = limit, -1
    x, y = (px - grid_x) / cell, (py - grid_y) / cell
    dx, dy = rx / cell, ry / cell
    i, j = int(np.floor(x)), int(np.floor(y))
    step_i, step_j = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    next_x = ((i + (1 if dx > 0 else 0)) - x) / dx if abs(dx) > 1e-12 else _FAR
    next_y = ((j + (1 if dy > 0 else 0)) - y) / dy if abs(dy) > 1e-12 else _FAR
    per_x = abs(1.0 / dx) if abs(dx) > 1e-12 else _FAR
    per_y = abs(1.0 / dy) if abs(dy) > 1e-12 else _FAR
    entered = 0.0
    while 0 <= i < columns and 0 <= j < rows and entered < best:
        for item in range(cell_start[j, i], cell_start[j, i + 1]):
            thing = cell_items[item]
            if stamps[thing] == stamp:
                continue
            stamps[thing] = stamp
            ox, oy, oz = px - centres[thing, 0], py - centres[thing, 1], pz - centres[thing, 2]
            along = -(ox * rx + oy * ry + oz * rz)
            radius = radii[thing]
            if ox * ox + oy * oy + oz * oz - along * along > radius * radius or along < -radius:
                continue
            if along - radius > best or thing == skip or (skip_instance > 0 and instances[thing] == skip_instance):
                continue
            turned = rotations[thing]
            half = half_sizes[thing]
            at = _enter(
                shapes[thing],
                half[0],
                half[1],
                half[2],
                turned[0, 0] * ox + turned[1, 0] * oy + turned[2, 0] * oz,
                turned[0, 1] * ox + turned[1, 1] * oy + turned[2, 1] * oz,
                turned[0, 2] * ox + turned[1, 2] * oy + turned[2, 2] * oz,
                turned[0, 0] * rx + turned[1, 0] * ry + turned[2, 0] * rz,
                turned[0, 1] * rx + turned[1, 1] * ry + turned[2, 1] * rz,
                turned[0, 2] * rx + turned[1, 2] * ry + turned[2, 2] * rz,
                best,
            )
            if at < best:
                best, found = at, thing
                if at <= enough:
                    return best, found
        if next_x < next_y:
            entered = next_x
            next_x += per_x
            i += step_i
        else:
            entered = next_y
            next_y += per_y
            j += step_j
    return best, found


@compiled
def _any_hit(start: Any, ray: Any, limit: Any, skip: Any, skip_instance: Any, world: Any, stamps: Any) -> Any:
    """Return (distance, primitive) of any occluder on a ray; (limit, -1) for a free ray."""
    return cast(start[0], start[1], start[2], ray[0], ray[1], ray[2], limit, limit, skip, skip_instance, world, stamps)


@compiled
def direct_light(  # noqa: PLR0913 - compiled functions take arrays, not objects
    points: Any,
    normals: Any,
    owners: Any,
    world: Any,
    panes: Any,
    lamps: Any,
    sun: Any,
    parts: Any,
    ceiling: Any,
    values: Any,
) -> None:
    """Write the linear RGB light that reaches every point from windows, lamps and the sun into `values` (N, 4).

    The fourth value is the distance from the surface at which rays start, metres, or 0 for a point inside a solid.
    Rows of `panes` have centre, two half axes, inward normal and area of a window. Rows of `lamps` have position, RGB
    power, instance and radius. `sun` has the direction to the sun and its RGB light. `parts` has the sampled points of
    a window, in its half axes, and of a lamp, in its radius.
    """
    start, ray = np.empty(3), np.empty(3)
    stamps = np.zeros(len(world[5]) + 1, np.int64)
    for number in range(len(points)):
        normal = normals[number]
        owner = owners[number]
        for k in range(4):  # one by one: an assignment of slices takes a second to compile
            values[number, k] = 0.0
        at = 0.0
        for lift in (_SKIN_M, 0.03):  # a thin covering may be on the point
            for k in range(3):
                start[k] = points[number, k] + lift * normal[k]
            at, _ = _any_hit(start, normal, 1e-3, owner, np.int64(0), world, stamps)
            if at != 0.0:
                values[number, 3] = lift
                break
        if at == 0.0:
            continue
        for pane in range(len(panes)):
            _add_window(start, normal, owner, world, panes[pane], parts[0], ray, stamps, values[number])
        for lamp in range(len(lamps)):
            _add_lamp(start, normal, owner, world, lamps[lamp], parts[1], ray, stamps, values[number])
        facing_us = sun[0] * normal[0] + sun[1] * normal[1] + sun[2] * normal[2]
        if facing_us > 0.0 and start[2] < ceiling:
            _add_sun(start, facing_us, owner, world, sun, ceiling, ray, stamps, values[number])


@compiled
def _add_window(  # noqa: PLR0913 - compiled functions take arrays, not objects
    start: Any, normal: Any, owner: Any, world: Any, pane: Any, parts: Any, ray: Any, stamps: Any, value: Any
) -> None:
    """Add the light of a window, sampled at several points, so that shadows are soft."""
    facing = 0.0
    for k in range(3):
        facing += (start[k] - pane[k]) * pane[9 + k]
    side = 1.0 if facing > 0.0 else -1.0
    total = 0.0
    for part in range(len(parts)):
        across, up = parts[part, 0], parts[part, 1]
        length = facing_us = facing_pane = 0.0
        for k in range(3):
            ray[k] = pane[k] + across * pane[3 + k] + up * pane[6 + k] - start[k]
            length += ray[k] * ray[k]
            facing_us += ray[k] * normal[k]
            facing_pane -= ray[k] * pane[9 + k] * side
        if facing_us <= 0.0 or facing_pane <= 0.0:
            continue
        form = pane[12] / len(parts) * facing_us * facing_pane / (np.pi * (length * length + 0.02))
        form -= 4e-4  # distant windows need many rays and add little light
        if form <= 0.0:
            continue
        length = np.sqrt(length)
        for k in range(3):
            ray[k] /= length
        _, thing = _any_hit(start, ray, length - 1e-3, owner, np.int64(0), world, stamps)
        if thing < 0:
            total += form
    value[0] += 3.1 * total
    value[1] += 3.25 * total
    value[2] += 3.45 * total


@compiled
def _add_lamp(  # noqa: PLR0913 - compiled functions take arrays, not objects
    start: Any, normal: Any, owner: Any, world: Any, lamp: Any, parts: Any, ray: Any, stamps: Any, value: Any
) -> None:
    """Add the light of a lamp, sampled at points of its horizontal disc."""
    total = 0.0
    for part in range(len(parts)):
        length = facing_us = 0.0
        for k in range(3):
            ray[k] = lamp[k] - start[k]
        ray[0] += lamp[7] * parts[part, 0]
        ray[1] += lamp[7] * parts[part, 1]
        for k in range(3):
            length += ray[k] * ray[k]
            facing_us += ray[k] * normal[k]
        if facing_us <= 0.0:
            continue
        form = facing_us / (np.sqrt(length) * (length + 0.15)) - 0.02
        if form <= 0.0:
            continue
        length = np.sqrt(length)
        for k in range(3):
            ray[k] /= length
        _, thing = _any_hit(start, ray, length - 1e-3, owner, np.int64(lamp[6]), world, stamps)
        if thing < 0:
            total += form / len(parts)
    for k in range(3):
        value[k] += lamp[3 + k] * total


@compiled
def _add_sun(  # noqa: PLR0913 - compiled functions take arrays, not objects
    start: Any, facing: Any, owner: Any, world: Any, sun: Any, ceiling: Any, ray: Any, stamps: Any, value: Any
) -> None:
    """Add the light of the sun, sampled in four directions."""
    grid_x, grid_y, cell, cell_start = world[0], world[1], world[2], world[3]
    wide, deep = (cell_start.shape[1] - 1) * cell, cell_start.shape[0] * cell
    for part in range(4):
        length = 0.0
        for k in range(3):
            ray[k] = sun[k]
        ray[0] += 0.02 * ((part % 2) - 0.5)
        ray[2] += 0.02 * ((part // 2) - 0.5)
        for k in range(3):
            length += ray[k] * ray[k]
        length = np.sqrt(length)
        for k in range(3):
            ray[k] /= length
        limit = (ceiling - start[2]) / ray[2]
        # The ray ends at the ceiling's height: the sun is visible only if the ray has left the building before.
        x, y = start[0] + limit * ray[0], start[1] + limit * ray[1]
        if grid_x + cell <= x <= grid_x + wide - cell and grid_y + cell <= y <= grid_y + deep - cell:
            continue
        _, thing = _any_hit(start, ray, limit, owner, np.int64(0), world, stamps)
        if thing < 0:
            for k in range(3):
                value[k] += 0.25 * sun[3 + k] * facing


@compiled
def fill_buried(start: Any, size: Any, values: Any) -> None:
    """Set every cell inside a solid to the mean of its lit neighbours, ring by ring."""
    for face in range(len(start)):
        wide, high, at = size[face, 0], size[face, 1], start[face]
        for _ in range(wide + high):
            missing = 0
            for t in range(high):
                for s in range(wide):
                    here = at + t * wide + s
                    if values[here, 3] != 0.0:
                        continue
                    total = red = green = blue = 0.0
                    for dt in range(-1, 2):
                        for ds in range(-1, 2):
                            if 0 <= t + dt < high and 0 <= s + ds < wide:
                                there = here + dt * wide + ds
                                if values[there, 3] == 1.0:
                                    total += 1.0
                                    red += values[there, 0]
                                    green += values[there, 1]
                                    blue += values[there, 2]
                    if total > 0.0:
                        values[here, 0] = red / total
                        values[here, 1] = green / total
                        values[here, 2] = blue / total
                        values[here, 3] = 2.0
                    else:
                        missing += 1
            lit = 0
            for k in range(at, at + wide * high):
                if values[k, 3] != 0.0:
                    values[k, 3] = 1.0
                    lit += 1
            if missing == 0 or lit == 0:
                break
