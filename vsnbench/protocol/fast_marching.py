"""Second-order fast marching (Sethian 1999): the distance to the zero contour of a function inside free cells."""

import math
from heapq import heappop, heappush
from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled

_STEPS = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
"""Neighbours (row, column): both of an axis, then both of the other."""


def signed_distance_m(level: Any, free: Any, resolution_m: float) -> Any:
    """Return the distance of each cell to the contour, negative where the function is; infinite if unreachable.

    The numbers are those of scikit-fmm's `distance(..., order=2)`.

    Args:
        level: (rows, columns) float64, continuous, with both signs.
        free: (rows, columns) bool: cells that a path may use.
        resolution_m: size of a cell.
    """
    distance = np.full(level.shape, np.inf)
    final, frozen = np.zeros(level.shape, np.bool_), np.empty((level.size, 2), np.int64)
    _march(np.ascontiguousarray(level, np.float64), free, resolution_m, _STEPS, distance, final, frozen)
    return distance


@compiled
def _march(level: Any, free: Any, resolution_m: float, steps: Any, distance: Any, final: Any, frozen: Any) -> None:
    """Write the distance of each cell; `final` is False at first, and `frozen` is space for cells of equal distance."""
    rows, columns = level.shape
    for row in range(rows):
        for column in range(columns):
            if free[row, column]:
                _begin(level, free, resolution_m, steps, distance, row, column)
                final[row, column] = distance[row, column] != np.inf
    waiting = [(0.0, 0) for _ in range(0)]  # empty, of a type that can be compiled
    for row in range(rows):
        for column in range(columns):
            if not free[row, column] or final[row, column]:
                continue
            for step in range(4):
                r, c = row + steps[step, 0], column + steps[step, 1]
                if 0 <= r < rows and 0 <= c < columns and final[r, c]:
                    distance[row, column] = _solved(level, final, resolution_m, distance, row, column)
                    heappush(waiting, (abs(distance[row, column]), row * columns + column))
                    break
    while waiting:
        key = waiting[0][0]
        count = 0
        while waiting and waiting[0][0] == key:  # cells of equal distance do not depend on each other
            row, column = divmod(heappop(waiting)[1], columns)
            if not final[row, column] and abs(distance[row, column]) == key:
                final[row, column] = True
                frozen[count, 0], frozen[count, 1] = row, column
                count += 1
        for number in range(count):
            for step in range(4):
                for width in (1, 2):
                    row = frozen[number, 0] + width * steps[step, 0]
                    column = frozen[number, 1] + width * steps[step, 1]
                    if not (0 <= row < rows and 0 <= column < columns) or not free[row, column]:
                        break
                    if final[row, column]:
                        continue
                    if width == 2 and distance[row, column] == np.inf:
                        break
                    found = _solved(level, final, resolution_m, distance, row, column)
                    if found != 0.0:
                        distance[row, column] = found
                        heappush(waiting, (abs(found), row * columns + column))
                    break
    for row in range(rows):
        for column in range(columns):
            if not final[row, column]:
                distance[row, column] = np.inf


@compiled
def _begin(level: Any, free: Any, resolution_m: float, steps: Any, distance: Any, row: int, column: int) -> None:
    """Set the distance of a cell on the contour or next to it."""
    rows, columns = level.shape
    here = level[row, column]
    if here == 0.0:
        distance[row, column] = 0.0
        return
    inverse_squares = 0.0
    for axis in range(2):
        nearest = 0.0
        for side in range(2):
            r, c = row + steps[2 * axis + side, 0], column + steps[2 * axis + side, 1]
            if 0 <= r < rows and 0 <= c < columns and free[r, c] and here * level[r, c] < 0:
                way = resolution_m * here / (here - level[r, c])
                if nearest == 0.0 or nearest > way:
                    nearest = way
        if nearest > 0.0:
            inverse_squares += 1 / nearest / nearest
    if inverse_squares > 0.0:
        distance[row, column] = math.copysign(math.sqrt(1 / inverse_squares), here)


@compiled
def _solved(level: Any, final: Any, resolution_m: float, distance: Any, row: int, column: int) -> float:
    """Return the distance of a cell from the final values of its neighbours.

    Where the second-order differences contradict each other, those of first order are used.
    """
    rows, columns = final.shape
    scale = 1 / resolution_m / resolution_m
    a = b = 0.0
    for order in (2, 1):
        a = b = c = 0.0
        for axis in range(2):
            first = second = np.inf
            for side in (-1, 1):
                r1, c1 = row + side * (1 - axis), column + side * axis
                if not (0 <= r1 < rows and 0 <= c1 < columns) or not final[r1, c1]:
                    continue
                if abs(distance[r1, c1]) >= abs(first):
                    continue
                first = distance[r1, c1]
                r2, c2 = r1 + side * (1 - axis), c1 + side * axis
                if order == 2 and 0 <= r2 < rows and 0 <= c2 < columns and final[r2, c2]:
                    further = distance[r2, c2]
                    if (further <= first and first >= 0) or (further >= first and first <= 0):
                        second = further
            if second != np.inf:
                value = (4 * first - second) * (1.0 / 3.0)
                a += scale * 2.25
                b -= scale * 2 * 2.25 * value
                c += scale * 2.25 * (value * value)
            elif first != np.inf:
                a += scale
                b -= scale * 2 * first
                c += scale * (first * first)
        discriminant = b * b - 4 * a * (c - 1)
        if discriminant >= 0:
            root = math.sqrt(discriminant)
            return (-b + root if level[row, column] > 0 else -b - root) / 2.0 / a
    return -b / (2.0 * a)
