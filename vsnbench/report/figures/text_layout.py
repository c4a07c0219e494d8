"""Text layout of figures: measures and wraps text, and sizes legends."""

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEGEND_PT = 6.5
_HANDLE_EM = 3.0
"""Width of a legend's sample line, in em."""
_GAP_EM = 2.2
"""Space between columns of a legend and around a sample line."""
_MARGIN_IN = 0.12
_LONGEST = 160
"""Maximum number of characters of a recorded name in a figure."""


def shown(text: str, most: int = _LONGEST) -> str:
    """Return a name as a sanitized label of bounded length; long names are cut in the middle."""
    words = sanitize(text)
    if len(words) <= most:
        return words
    end = (most - 1) // 2
    return f"{words[: most - 1 - end]}…{words[-end:]}"


def width_in(text: str, size_pt: float) -> float:
    """Return the width of a line of text, inches."""
    return _width_of(text, size_pt) / 72


def wrapped(text: str, room_in: float, size_pt: float) -> str:
    """Wrap a name to the available width; words wider than that are broken."""
    lines: list[str] = []
    for word in shown(text).split(" "):
        whole = f"{lines[-1]} {word}" if lines else word
        if lines and width_in(whole, size_pt) <= room_in:
            lines[-1] = whole
            continue
        rest = word
        while width_in(rest, size_pt) > room_in and len(rest) > 1:
            fits = next((cut for cut in range(len(rest) - 1, 1, -1) if width_in(rest[:cut], size_pt) <= room_in), 1)
            lines.append(rest[:fits])
            rest = rest[fits:]
        lines.append(rest)
    return "\n".join(lines)


def legend_below(figure: "Figure", handles: Sequence[Any], labels: Sequence[str]) -> None:
    """Put a legend below a figure and increase the figure's height by that of the legend.

    The legend has as many columns as fit; labels wider than the figure are wrapped.
    """
    room_in = figure.get_figwidth() - 2 * _MARGIN_IN
    em_in = LEGEND_PT / 72
    beside_in = (_HANDLE_EM + _GAP_EM) * em_in
    words = [wrapped(label, room_in - beside_in, LEGEND_PT) for label in labels]
    widths = [beside_in + max(width_in(line, LEGEND_PT) for line in label.split("\n")) for label in words]
    columns = max(
        count for count in range(1, len(words) + 1) if count == 1 or _taken_in(widths, count) + em_in <= room_in
    )
    look: dict[str, Any] = {"handlelength": _HANDLE_EM, "handletextpad": 0.6, "columnspacing": 1.4}
    legend = figure.legend(
        *(list(handles), words),
        loc="outside lower center",
        ncols=columns,
        fontsize=LEGEND_PT,
        borderaxespad=0.4,
        **look,
    )
    height_px = legend.get_window_extent(figure.canvas.get_renderer()).height  # type: ignore[attr-defined]
    figure.set_size_inches(figure.get_figwidth(), figure.get_figheight() + height_px / figure.dpi + 0.04)


def _taken_in(widths: Sequence[float], columns: int) -> float:
    """Return the width of a legend with this number of columns, filled column by column as in matplotlib."""
    return sum(float(column.max()) for column in np.array_split(widths, columns))


@cache
def _width_of(text: str, size_pt: float) -> float:
    from matplotlib.font_manager import FontProperties, findfont, get_font

    font = get_font(findfont(FontProperties(family=["sans-serif"])))
    font.set_size(size_pt, 72)
    font.set_text(text, 0.0)
    width, _ = font.get_width_height()
    return float(width) / 64
