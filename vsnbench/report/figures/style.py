"""Style of figures: marks and dashes of conditions, sizes for a two-column paper, and saving."""

import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar

from vsnbench.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Item = TypeVar("_Item")

COLUMN_IN = 3.4
"""Width of one column of a paper, inches, unless another is given."""
_GUTTER_IN = 0.3
"""Space between two columns, inches."""
TEXT_PT = 7.0
"""Size of most text, points, where the width of the column is not given."""
PAPER_TEXT_PT = 8.0
"""Size of the same text where it is."""
_COLUMN_IN: ContextVar[float | None] = ContextVar("column_in", default=None)

DOTS_AN_INCH = 200
"""Resolution of the PNG."""

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

MAX_CONDITIONS = len(COLORS)
"""Maximum number of distinguishable conditions in one figure."""


@contextmanager
def column_of(width_in: float | None) -> Iterator[None]:
    """Draw figures for columns of this width, inches, with text of `PAPER_TEXT_PT`; None for the default."""
    before = _COLUMN_IN.set(width_in)
    try:
        yield
    finally:
        _COLUMN_IN.reset(before)


PAGE_FORMATS = ("svg",)
"""Formats that a page of a report shows."""
FORMATS = (*PAGE_FORMATS, "pdf", "png")
"""Formats of the files of a report."""


def enlargement() -> float:
    """Return the factor by which figures are enlarged after they were laid out with text of `TEXT_PT`."""
    return 1.0 if _COLUMN_IN.get() is None else PAPER_TEXT_PT / TEXT_PT


def column_in() -> float:
    """Return the width of one column before enlargement, inches."""
    return (_COLUMN_IN.get() or COLUMN_IN) / enlargement()


def page_in() -> float:
    """Return the width of a page of two columns before enlargement, inches."""
    return (2 * (_COLUMN_IN.get() or COLUMN_IN) + _GUTTER_IN) / enlargement()


def _enlarge(figure: "Figure", factor: float) -> None:
    """Enlarge a figure that is laid out, and all of its text."""
    from matplotlib.text import Text

    figure.set_size_inches(*(factor * side for side in figure.get_size_inches()))
    for text in figure.findobj(Text):
        text.set_fontsize(factor * float(text.get_fontsize()))


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A figure with its title, caption and text alternative."""

    name: str
    """Name for files and anchors."""
    title: str
    alt: str
    """Text alternative; the numbers are in the tables."""
    caption: str
    """Description, and what is left out."""
    footnotes: tuple[str, ...]
    """Explanations of the names."""
    figure: "Figure | None"
    """None after `finish`."""
    width_in: float = field(init=False)
    height_in: float = field(init=False)
    is_wide: bool = field(init=False)
    """Whether the figure needs more than one column."""
    _factor: float = field(default_factory=enlargement, init=False, repr=False)
    _files: dict[str, bytes] = field(default_factory=dict, init=False, repr=False)
    """Saved formats, because the page and the directory need the same files."""

    def __post_init__(self) -> None:
        width_in, height_in = (0.0, 0.0) if self.figure is None else self.figure.get_size_inches()
        object.__setattr__(self, "width_in", self._factor * float(width_in))
        object.__setattr__(self, "height_in", self._factor * float(height_in))
        object.__setattr__(self, "is_wide", float(width_in) > 1.2 * column_in())

    def finish(self, formats: Sequence[str] = FORMATS) -> Self:
        """Save the figure in some formats and drop it, so that the drawing can be sent to another process."""
        for form in formats:
            self._saved(form)
        object.__setattr__(self, "figure", None)
        return self

    def svg(self) -> bytes:
        """Return the figure as SVG; deterministic."""
        return self._saved("svg")

    def png(self) -> bytes:
        """Return the figure as PNG with `DOTS_AN_INCH`."""
        return self._saved("png")

    def pdf(self) -> bytes:
        """Return the figure as PDF."""
        return self._saved("pdf")

    def _saved(self, form: str) -> bytes:
        import matplotlib as mpl

        if form not in self._files and self.figure is not None:
            with mpl.rc_context({**_SETTINGS, "svg.hashsalt": self.name}):
                engine = self.figure.get_layout_engine()
                if engine is not None:
                    # Lay out once for all formats, because it takes as long as drawing.
                    engine.execute(self.figure)
                    self.figure.set_layout_engine("none")
                if not self._files and self._factor != 1:
                    _enlarge(self.figure, self._factor)
                self._files[form] = _printed(self.figure, form)
        return self._files[form]


def _printed(figure: "Figure", form: str) -> bytes:
    """Return the figure as SVG, PDF or PNG; `Figure.savefig` would draw it twice."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    file, dots = io.BytesIO(), figure.dpi
    match form:
        case "svg":
            FigureCanvasSVG(figure).print_svg(file, metadata={"Date": None})  # type: ignore[no-untyped-call]
        case "pdf":
            FigureCanvasPdf(figure).print_pdf(file, metadata={"CreationDate": None})  # type: ignore[no-untyped-call]
        case _:
            FigureCanvasAgg(figure).print_png(file)  # type: ignore[no-untyped-call]
    figure.dpi = dots  # vector formats change it
    return file.getvalue()


_SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": TEXT_PT,
    "axes.titlesize": 7.5,
    "axes.titley": 1.0,  # a fixed value avoids a search for tick labels above the axes at every drawing
    "axes.labelsize": TEXT_PT,
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
    "text.parse_math": False,  # names may contain dollar signs
}


@contextmanager
def styled() -> Iterator[None]:
    """Apply the report's style, independent of the user's settings."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_SETTINGS)
        yield


def new_figure(width_in: float, height_in: float) -> "Figure":
    """Return an empty figure with automatic layout; no window is opened."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_AN_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def in_pages(items: Sequence[_Item], most: int, draw: Callable[[Sequence[_Item]], Drawing]) -> Iterator[Drawing]:
    """Draw the items in as many figures as needed; the names and titles of several figures are numbered.

    Args:
        items: what the figures show.
        most: maximum number of items in a figure.
        draw: draws the figure of some items.
    """
    pages = [items[at : at + most] for at in range(0, len(items), most)]
    for number, page in enumerate(pages, start=1):
        drawing = draw(page)
        if len(pages) > 1:
            name = drawing.name if number == 1 else f"{drawing.name}-{number}"
            drawing = replace(drawing, name=name, title=f"{drawing.title} ({number} of {len(pages)})")
        yield drawing


def panel_axes(figure: "Figure", panels: int, columns: int) -> "list[Axes]":
    """Return the axes of each panel, row by row; the rest of the last row stays empty."""
    axes = list(figure.subplots(math.ceil(panels / columns), columns, squeeze=False).flat)
    for unused in axes[panels:]:
        unused.set_axis_off()
    return axes[:panels]


def light_grid(axes: "Axes", axis: str) -> None:
    """Draw thin grid lines behind the data."""
    axes.grid(visible=True, axis=axis, color="#e2e2e2", linewidth=0.5)  # type: ignore[arg-type]
    axes.set_axisbelow(True)
