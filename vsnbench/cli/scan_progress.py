"""What a person at the terminal sees of a scan: the map as it grows with the robot on it, and what it did last."""

import math
import sys
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from vsnbench.runner.scan import ScanState
from vsnbench.sensing.plan_grid import FREE, OCCUPIED

_ROWS, _COLUMNS = 20, 76
_LINE_EVERY = 25
"""Actions between two lines where stderr is no terminal."""
_ARROWS = "→↗↑↖←↙↓↘"
_SQUARE = 1e-6
"""Of a map whose cells lie along x and y; those of a turned one leave gaps between smaller letters."""


class ScanProgress:
    """A map in letters on stderr; plain lines where stderr is no terminal."""

    def __init__(self, keys: str = "") -> None:
        """Show `keys`, what can be typed, below the map."""
        self._console = Console(file=sys.stderr, highlight=False)
        self._keys = keys
        self._live = Live(console=self._console, transient=True, refresh_per_second=8)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def tell(self, state: ScanState) -> None:
        """Show a state."""
        if self._console.is_terminal:
            parts = [Text(map_in_letters(state, _ROWS, min(_COLUMNS, self._console.width - 2))), Text(_words(state))]
            self._live.update(Group(*parts, *([Text(self._keys, style="dim")] if self._keys else [])))
        elif state.actions % _LINE_EVERY == 0:
            self._console.print(_words(state))


def _words(state: ScanState) -> str:
    x_m, y_m = state.standing.position
    here = f"at ({x_m:.2f}, {y_m:.2f}) {math.degrees(state.standing.heading_rad) % 360:.0f}°"
    note = f"; {state.note}" if state.note else ""
    return f"{state.actions} actions, {state.seen_free_m2:.1f} m² of floor seen, {here}{note}"


def map_in_letters(state: ScanState, rows: int, columns: int) -> str:
    """Return the known part of a map in at most so many letters: # occupied, . free, an arrow for the robot.

    As it is written: x to the right and y up in the site's frame, where a site is named.
    """
    grid = state.grid()
    row, column = np.nonzero((grid.cells == FREE) | (grid.cells == OCCUPIED))
    if not len(row):
        return ""
    points = grid.in_site(np.column_stack((column + 0.5, row + 0.5)))
    corner, (width_m, height_m) = points.min(axis=0), np.ptp(points, axis=0)
    square = abs(math.sin(2 * grid.origin.heading_rad)) < _SQUARE
    across_m = max(grid.resolution_m * (1 if square else 2), width_m / (columns - 1), height_m / (rows - 1) / 2)

    def place(points: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        right, up = ((np.atleast_2d(points) - corner) / (across_m, 2 * across_m)).T  # a letter is twice as high as wide
        return np.floor(up).astype(np.intp), np.floor(right).astype(np.intp)

    letters = np.full((rows, columns), " ")
    occupied = grid.cells[row, column] == OCCUPIED
    letters[place(points[~occupied])] = "."
    letters[place(points[occupied])] = "#"
    (up,), (right,) = place(state.standing.position)
    if 0 <= up < rows and 0 <= right < columns:
        letters[up, right] = _ARROWS[round(state.standing.heading_rad / (math.pi / 4)) % 8]
    return "\n".join("".join(line).rstrip() for line in letters[::-1]).strip("\n")
