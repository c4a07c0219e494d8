"""What a person at the terminal sees of a scan: the map as it grows with the robot on it, and what it did last."""

import math
import sys
from types import TracebackType
from typing import Self

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from vsnbench.runner.scan import ScanState
from vsnbench.sensing.plan_grid import FREE, OCCUPIED

_ROWS, _COLUMNS = 20, 76
_LINE_EVERY = 25
"""Actions between two lines where stderr is no terminal."""
_ARROWS = "→↗↑↖←↙↓↘"


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
    x_m, y_m = state.pose.position
    here = f"at ({x_m:.2f}, {y_m:.2f}) {math.degrees(state.pose.heading_rad) % 360:.0f}°"
    note = f"; {state.note}" if state.note else ""
    return f"{state.actions} actions, {state.seen_free_m2:.1f} m² of floor seen, {here}{note}"


def map_in_letters(state: ScanState, rows: int, columns: int) -> str:
    """Return the known part of a map in at most so many letters: # occupied, . free, an arrow for the robot."""
    drawn = state.map.grid_map()
    height, width = drawn.cells.shape
    across = max(1, math.ceil(width / columns), math.ceil(height / rows / 2))
    down = 2 * across  # a letter is about twice as high as wide
    padded = np.pad(drawn.cells, ((0, -height % down), (0, -width % across)))
    blocks = padded.reshape(padded.shape[0] // down, down, padded.shape[1] // across, across)
    letters = np.where(
        (blocks == OCCUPIED).any(axis=(1, 3)), "#", np.where((blocks == FREE).any(axis=(1, 3)), ".", " ")
    )
    row = math.floor((state.pose.y_m - drawn.origin_y_m) / drawn.resolution_m / down)
    column = math.floor((state.pose.x_m - drawn.origin_x_m) / drawn.resolution_m / across)
    if 0 <= row < letters.shape[0] and 0 <= column < letters.shape[1]:
        letters[row, column] = _ARROWS[round(state.pose.heading_rad / (math.pi / 4)) % 8]
    return "\n".join("".join(line).rstrip() for line in letters[::-1])
