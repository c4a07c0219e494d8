"""How figures look: colours that colour-blind readers tell apart, sizes of a two-column paper, one way to save."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from vsnbench.report.text import harmless

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN_IN = 3.4
"""Width of one column, inches."""
PAGE_IN = 7.1
"""Width of both."""

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7A6A00", "#000000")
"""Okabe and Ito's, in an order in which neighbours differ most; the yellow is darkened to be seen on white."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES: tuple[tuple[int, tuple[float, ...]], ...] = (
    (0, ()),
    (0, (5, 1.5)),
    (0, (1, 1)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (8, 2)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (1, 3)),
    (0, (2, 2)),
)
INK, FAINT = "#1a1a1a", "#8c8c8c"

SUCCESS, FAILURE, COLLISION, LIMIT = "#0072B2", "#D55E00", "#000000", "#CC79A7"
"""Of outcomes: success, STOP too far away, collision, cap on actions."""

MOST_CONDITIONS = len(COLORS)
"""More than this many cannot be told apart in one figure."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A figure with the words that stand in for it."""

    name: str
    """For file names and anchors."""
    title: str
    alt: str
    """What it shows, for who cannot see it; the numbers are in the tables."""
    figure: "Figure"
    _files: dict[str, bytes] = field(default_factory=dict, repr=False)
    """What has been saved already: the page and the directory want the same."""

    def svg(self) -> bytes:
        """Return the figure as SVG; the same figure gives the same bytes."""
        return self._saved("svg")

    def png(self) -> bytes:
        """Return the figure as PNG of 200 dots an inch."""
        return self._saved("png")

    def pdf(self) -> bytes:
        """Return the figure as PDF."""
        return self._saved("pdf")

    def _saved(self, form: str) -> bytes:
        import matplotlib as mpl

        if form in self._files:
            return self._files[form]
        file = io.BytesIO()
        dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
        with mpl.rc_context({**_SETTINGS, "svg.hashsalt": self.name}):
            if self.figure.get_layout_engine() is not None:
                # Laid out once: it takes longer than the drawing, and every save would do it again.
                self.figure.draw_without_rendering()
                self.figure.set_layout_engine("none")
            self.figure.savefig(file, format=form, dpi=200, metadata=dates.get(form))
        self._files[form] = file.getvalue()
        return self._files[form]


_SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 7,
    "axes.titlesize": 7.5,
    "axes.labelsize": 7,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "text.parse_math": False,  # a dollar in a name is a dollar
}


@contextmanager
def styled() -> Iterator[None]:
    """Make every figure within look alike, whatever the user's own settings are."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Return an empty figure that lays itself out; no window is ever opened."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def shown(text: str, most: int = 48) -> str:
    """Return a name as a label: one harmless line of bounded length."""
    words = harmless(text)
    return words if len(words) <= most else f"{words[: most - 1]}…"


def light_grid(axes: "Axes", axis: str) -> None:
    """Draw thin lines behind the data to read values off."""
    axes.grid(visible=True, axis=axis, color="#e2e2e2", linewidth=0.5)  # type: ignore[arg-type]
    axes.set_axisbelow(True)
