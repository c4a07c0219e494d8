"""The planner's inner loops: fast marching over a grid, and the search over short sequences of actions."""

import math
from typing import Any

import numpy as np

from vsnbench.runtime.numba_cache import compiled


@compiled
def march(slowness: Any, sources: Any, target: Any, margin: Any, field: Any, keys: Any, cells: Any) -> None:
    """Solve the eikonal equation by first-order fast marching (Sethian 1996).

    Args:
        slowness: (rows, columns) float32: cost of a cell's width; infinite if the cell is blocked.
        sources: indices into the flat grid where the field is 0.
        target: index of a cell, or -1: marching ends `margin` after its value is final.
        margin: see `target`.
        field: (rows, columns) float64, output: cost to the nearest source, infinite if unknown or unreachable.
        keys: float64 buffer with at least 5 elements per cell.
        cells: int32 buffer of the same length.
    """
    rows, columns = slowness.shape
    field[:] = math.inf
    final = np.zeros((rows, columns), np.bool_)
    size = 0
    for source in sources:
        field[source // columns, source % columns] = 0.0
        keys[size] = 0.0
        cells[size] = source
        size += 1
    limit = math.inf
    while size > 0:
        key = keys[0]
        cell = cells[0]
        size -= 1
        last_key = keys[size]
        last_cell = cells[size]
        at = 0
        while True:
            child = 2 * at + 1
            if child >= size:
                break
            if child + 1 < size and keys[child + 1] < keys[child]:
                child += 1
            if keys[child] >= last_key:
                break
            keys[at] = keys[child]
            cells[at] = cells[child]
            at = child
        keys[at] = last_key
        cells[at] = last_cell
        row = cell // columns
        column = cell % columns
        if final[row, column]:
            continue
        if key > limit:
            break
        final[row, column] = True
        if cell == target:
            limit = key + margin
        for side in range(4):
            r, c = row, column
            if side == 0:
                r -= 1
            elif side == 1:
                r += 1
            elif side == 2:
                c -= 1
            else:
                c += 1
            if r < 0 or c < 0 or r >= rows or c >= columns or final[r, c]:
                continue
            step = slowness[r, c]
            if step == math.inf:
                continue
            across = math.inf
            if c > 0 and final[r, c - 1]:
                across = field[r, c - 1]
            if c + 1 < columns and final[r, c + 1]:
                across = min(across, field[r, c + 1])
            along = math.inf
            if r > 0 and final[r - 1, c]:
                along = field[r - 1, c]
            if r + 1 < rows and final[r + 1, c]:
                along = min(along, field[r + 1, c])
            apart = across - along if across > along else along - across
            if apart >= step:  # also if one of them is infinite
                time = min(across, along) + step
            else:
                time = 0.5 * (across + along + math.sqrt(2.0 * step * step - apart * apart))
            if time < field[r, c]:
                field[r, c] = time
                at = size
                size += 1
                while at > 0:
                    parent = (at - 1) // 2
                    if keys[parent] <= time:
                        break
                    keys[at] = keys[parent]
                    cells[at] = cells[parent]
                    at = parent
                keys[at] = time
                cells[at] = r * columns + c
    for row in range(rows):
        for column in range(columns):
            if not final[row, column]:
                field[row, column] = math.inf


@compiled
def move_is_free(open_cells: Any, obstacles: Any, grid: Any, body: Any, x: float, y: float, heading: float) -> bool:
    """Return whether a forward move stays in open cells and has the free distance that the depth guard requires.

    Args:
        open_cells: (rows, columns) bool: free cells for the robot's centre.
        obstacles: (rows, columns) bool: obstacle cells.
        grid: origin x, y, resolution.
        body: forward move, half width of the swath, length of the swath from the centre, metres.
        x: metres.
        y: metres.
        heading: radians.
    """
    rows, columns = open_cells.shape
    cos, sin = math.cos(heading), math.sin(heading)
    steps = max(1, math.ceil(body[0] / (0.5 * grid[2])))
    for k in range(1, steps + 1):
        way = body[0] * k / steps
        row = math.floor((y + sin * way - grid[1]) / grid[2])
        column = math.floor((x + cos * way - grid[0]) / grid[2])
        if row < 0 or column < 0 or row >= rows or column >= columns or not open_cells[row, column]:
            return False
    reach = body[2] + body[1]
    low_row = max(0, math.floor((y - reach - grid[1]) / grid[2]))
    high_row = min(rows - 1, math.floor((y + reach - grid[1]) / grid[2]))
    low_column = max(0, math.floor((x - reach - grid[0]) / grid[2]))
    high_column = min(columns - 1, math.floor((x + reach - grid[0]) / grid[2]))
    for row in range(low_row, high_row + 1):
        away_y = grid[1] + (row + 0.5) * grid[2] - y
        for column in range(low_column, high_column + 1):
            if obstacles[row, column]:
                away_x = grid[0] + (column + 0.5) * grid[2] - x
                ahead = cos * away_x + sin * away_y
                if 0.0 < ahead <= body[2] and abs(cos * away_y - sin * away_x) <= body[1]:
                    return False
    return True


@compiled
def search_actions(  # noqa: PLR0913 - compiled functions take arrays, not objects
    field: Any,
    open_cells: Any,
    obstacles: Any,
    grid: Any,
    body: Any,
    pose: Any,
    turn: float,
    first_is_refused: bool,
    depth: int,
    plan: Any,
) -> float:
    """Find the shortest sequence of turns and forward moves towards the field's source.

    A sequence has up to `depth` forward moves (at most 4), each after any number of turns; its cost is its number of
    actions, plus the field at its end counted in forward moves.

    Args:
        field: (rows, columns) path cost to the target, in metres at full speed.
        open_cells: see `move_is_free`.
        obstacles: see `move_is_free`.
        grid: see `move_is_free`.
        body: see `move_is_free`.
        pose: x, y, heading.
        turn: angle of one turn, radians.
        first_is_refused: whether a forward move without a turn is known to be impossible.
        depth: maximum number of forward moves.
        plan: (depth,) int64, output: turns before each forward move, left positive; 127 ends the sequence.

    Returns:
        The cost; infinite if no sequence leads nearer.
    """
    rows, columns = field.shape
    half = round(math.pi / turn)
    fan = 2 * half if abs(2 * half * turn - 2 * math.pi) < 1e-6 else 2 * half + 1
    best = math.inf
    index = np.zeros(depth, np.int64)
    xs, ys = np.zeros(depth + 1), np.zeros(depth + 1)
    headings, costs = np.zeros(depth + 1), np.zeros(depth + 1)
    xs[0], ys[0], headings[0] = pose[0], pose[1], pose[2]
    here_row = math.floor((pose[1] - grid[1]) / grid[2])
    here_column = math.floor((pose[0] - grid[0]) / grid[2])
    here = math.inf
    if 0 <= here_row < rows and 0 <= here_column < columns:
        here = field[here_row, here_column]
    plan[:] = 127
    level = 0
    while level >= 0:
        if index[level] >= fan:
            index[level] = 0
            level -= 1
            continue
        order = index[level]
        index[level] += 1
        turns = (order + 1) // 2 if order % 2 == 1 else -(order // 2)
        cost = costs[level] + abs(turns) + 1
        if cost >= best or (level == 0 and turns == 0 and first_is_refused):
            continue
        heading = headings[level] + turns * turn
        if not move_is_free(open_cells, obstacles, grid, body, xs[level], ys[level], heading):
            continue
        x = xs[level] + body[0] * math.cos(heading)
        y = ys[level] + body[0] * math.sin(heading)
        row = math.floor((y - grid[1]) / grid[2])
        column = math.floor((x - grid[0]) / grid[2])
        left = field[row, column]
        if left == math.inf:
            continue
        total = cost + left / body[0]
        if total < best and left < here:
            best = total
            for k in range(depth):
                if k <= level:
                    before = index[k] - 1
                    plan[k] = (before + 1) // 2 if before % 2 == 1 else -(before // 2)
                else:
                    plan[k] = 127
        if level + 1 < depth:
            level += 1
            xs[level], ys[level], headings[level], costs[level] = x, y, heading, cost
            index[level] = 0
    return best
