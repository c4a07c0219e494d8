"""Collects areas and lines of a floor plan and draws them layer by layer."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#1a1a1a"
Dashes = tuple[float, tuple[float, ...]]
SOLID: Dashes = (0, ())


class Ink:
    """Areas and lines of a plan, metres in the site's frame; one artist per layer."""

    def __init__(self) -> None:
        self._areas: dict[float, list[tuple[list[tuple[float, float]], str, str, float, Any]]] = {}
        self._lines: dict[float, list[tuple[list[tuple[float, float]], str, float]]] = {}

    def fill(
        self,
        outline: Iterable[tuple[float, ...]],
        *,
        layer: float,
        face: str = "none",
        edge: str = "none",
        width_pt: float = 0.0,
        dashes: Dashes | None = None,
    ) -> None:
        """Add an area; later areas of a layer cover earlier ones."""
        corners = [(point[0], point[1]) for point in outline]
        self._areas.setdefault(layer, []).append((corners, face, edge, width_pt, dashes or SOLID))

    def line(self, points: Iterable[tuple[float, float]], *, layer: float, color: str, width_pt: float) -> None:
        """Add a line with square ends."""
        self._lines.setdefault(layer, []).append((list(points), color, width_pt))

    def put_on(self, axes: "Axes") -> None:
        """Draw everything without changing the limits of the axes."""
        from matplotlib.collections import LineCollection, PolyCollection

        for layer, areas in self._areas.items():
            outlines, faces, edges, widths, dashes = (list(column) for column in zip(*areas, strict=True))
            look: dict[str, Any] = {"facecolors": faces, "edgecolors": edges, "linewidths": widths}
            axes.add_collection(PolyCollection(outlines, linestyles=dashes, zorder=layer, **look), autolim=False)
        for layer, lines in self._lines.items():
            paths, colors, widths = (list(column) for column in zip(*lines, strict=True))
            axes.add_collection(
                LineCollection(paths, colors=colors, linewidths=widths, zorder=layer, capstyle="butt"), autolim=False
            )
