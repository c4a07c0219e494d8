"""Kernels of the occupancy map."""

import math
from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled


@compiled
def project(  # noqa: PLR0913 - compiled functions take arrays, not objects
    depth_m: Any,
    ahead: Any,
    left: Any,
    up: Any,
    mount: Any,
    pose: Any,
    grid: Any,
    band: Any,
    hits: Any,
    floor: Any,
    reach: Any,
) -> None:
    """Count points by cell, and measure how far each image column sees along the floor.

    Args:
        depth_m: (H, W) float32, NaN where invalid.
        ahead: (H,) forward component of the rays per metre of depth.
        left: (W,) left component of the rays per metre of depth.
        up: (H,) upward component of the rays per metre of depth.
        mount: forward offset and height of the camera, metres.
        pose: x, y, cosine and sine of the heading.
        grid: origin x, y and resolution of the map, metres.
        band: lowest and highest point of an obstacle and longest range, metres; fewest points of an obstacle.
        hits: (rows, columns) int32, incremented by points of obstacles.
        floor: (rows, columns) int32, incremented by points of the floor.
        reach: (W,) float64, written: horizontal distance from the camera to the nearest obstacle of the column, or to
            the farthest point; 0 for a column with too few valid pixels.
    """
    height, width = depth_m.shape
    rows, columns = hits.shape
    bottom, top, farthest = band[0], band[1], band[2]
    for column in range(width):
        sideways = left[column]
        stretch = math.sqrt(1.0 + sideways * sideways)
        nearest, second = math.inf, math.inf
        seen_to = 0.0
        invalid, looked = 0, 0
        for row in range(height):
            z = depth_m[row, column]
            slope = up[row]
            # Whether the ray can meet an obstacle within the range.
            crosses = slope * farthest + mount[1] < top
            if crosses:
                looked += 1
            if not (z > 0.0 and z < math.inf):
                if crosses:
                    invalid += 1
                continue
            ahead_of_lens = z * ahead[row]
            height_m = z * slope + mount[1]
            if height_m > top:
                continue
            flat = math.hypot(ahead_of_lens, z * sideways)
            if height_m >= bottom:
                if flat < nearest:
                    second = nearest
                    nearest = flat
                elif flat < second:
                    second = flat
            elif flat > (second if band[3] >= 2 else nearest):
                continue  # floor under an obstacle
            seen_to = max(seen_to, flat)
            if flat > farthest:
                continue
            forward = ahead_of_lens + mount[0]
            lateral = z * sideways
            x = pose[0] + pose[2] * forward - pose[3] * lateral
            y = pose[1] + pose[3] * forward + pose[2] * lateral
            at_row = math.floor((y - grid[1]) / grid[2])
            at_column = math.floor((x - grid[0]) / grid[2])
            if at_row < 0 or at_column < 0 or at_row >= rows or at_column >= columns:
                continue
            if height_m >= bottom:
                hits[at_row, at_column] += 1
            else:
                floor[at_row, at_column] += 1
        if 2 * invalid > looked:
            reach[column] = 0.0
        else:
            stop = second if band[3] >= 2 else nearest
            reach[column] = min(stop, seen_to, farthest * stretch)


@compiled
def carve(
    reach: Any,
    left: Any,
    mount: Any,
    pose: Any,
    grid: Any,
    near_m: Any,
    crossed: Any,
) -> None:
    """Mark the cells that the columns of an image see across.

    `crossed` (rows, columns) uint8 becomes 2 for cells at least `near_m` from the camera, else 1: a low obstacle may be
    below the view there.
    """
    rows, columns = crossed.shape
    step = grid[2] * 0.5
    eye_x = pose[0] + pose[2] * mount[0]
    eye_y = pose[1] + pose[3] * mount[0]
    for column in range(reach.shape[0]):
        if reach[column] <= 0.0:
            continue
        stretch = math.sqrt(1.0 + left[column] * left[column])
        direction_x = (pose[2] - pose[3] * left[column]) / stretch
        direction_y = (pose[3] + pose[2] * left[column]) / stretch
        # The last cell before the obstacle often belongs to its edge.
        for k in range(int((reach[column] - grid[2]) / step)):
            far = k * step
            at_row = math.floor((eye_y + far * direction_y - grid[1]) / grid[2])
            at_column = math.floor((eye_x + far * direction_x - grid[0]) / grid[2])
            if at_row < 0 or at_column < 0 or at_row >= rows or at_column >= columns:
                break
            mark = 2 if far >= near_m else 1
            if mark > crossed[at_row, at_column]:
                crossed[at_row, at_column] = mark


@compiled
def weigh(
    hits: Any,
    floor: Any,
    crossed: Any,
    points: Any,
    image: Any,
    evidence: Any,
    observed: Any,
    newest: Any,
) -> None:
    """Add the votes of one image to the evidence (float32, positive for an obstacle), limited to -2 and +5.

    `newest` (int32) becomes the number of the image where it votes.
    """
    rows, columns = hits.shape
    for row in range(rows):
        for column in range(columns):
            if hits[row, column] >= points:
                evidence[row, column] = min(max(evidence[row, column], np.float32(0.0)) + np.float32(1.0), 5.0)
            elif crossed[row, column] == 2 or (floor[row, column] > 0 and hits[row, column] == 0):
                evidence[row, column] = max(evidence[row, column] - np.float32(0.5), -2.0)
            elif crossed[row, column] == 1 and not observed[row, column]:
                evidence[row, column] = np.float32(-0.5)
            else:
                continue
            observed[row, column] = True
            newest[row, column] = image
