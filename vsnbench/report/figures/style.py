"""How figures look: colours that colour-blind readers tell apart, sizes of a two-column paper, one way to save."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self, TypeVar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Item = TypeVar("_Item")

COLUMN_IN = 3.4
"""Width of one column, inches."""
PAGE_IN = 7.1
"""Width of both."""

DOTS_AN_INCH = 200
"""Of the PNG."""

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
    caption: str
    """How to read it, and what is left out."""
    footnotes: tuple[str, ...]
    """What the names in it stand for."""
    figure: "Figure | None"
    """None once it is finished."""
    width_in: float = field(init=False)
    height_in: float = field(init=False)
    _files: dict[str, bytes] = field(default_factory=dict, init=False, repr=False)
    """What has been saved already: the page and the directory want the same."""

    def __post_init__(self) -> None:
        width_in, height_in = (0.0, 0.0) if self.figure is None else self.figure.get_size_inches()
        object.__setattr__(self, "width_in", float(width_in))
        object.__setattr__(self, "height_in", float(height_in))

    def finish(self) -> Self:
        """Save it in every form and let go of the figure: what is left can go from one process to another."""
        for form in ("svg", "pdf", "png"):
            self._saved(form)
        object.__setattr__(self, "figure", None)
        return self

    def svg(self) -> bytes:
        """Return the figure as SVG; the same figure gives the same bytes."""
        return self._saved("svg")

    def png(self) -> bytes:
        """Return the figure as PNG of `DOTS_AN_INCH`."""
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
                    # Laid out once: it takes as long as the drawing, and every save would do it again.
                    engine.execute(self.figure)
                    self.figure.set_layout_engine("none")
                self._files[form] = _printed(self.figure, form)
        return self._files[form]


def _printed(figure: "Figure", form: str) -> bytes:
    """Return the figure as SVG, PDF or PNG; `Figure.savefig` would draw it twice, once to measure it."""
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
    figure.dpi = dots  # vector formats have set their own and leave it so
    return file.getvalue()


_SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 7,
    "axes.titlesize": 7.5,
    "axes.titley": 1.0,  # no axes have tick labels above them: matplotlib would look for some at every drawing
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

    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_AN_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def in_pages(items: Sequence[_Item], most: int) -> list[Sequence[_Item]]:
    """Return the items in groups of so many, for a figure each."""
    return [items[at : at + most] for at in range(0, len(items), most)]


def page_name(name: str, number: int) -> str:
    """Return the name of a figure that goes over several pages, from 1; the first has the bare name."""
    return name if number == 1 else f"{name}-{number}"


def light_grid(axes: "Axes", axis: str) -> None:
    """Draw thin lines behind the data to read values off."""
    axes.grid(visible=True, axis=axis, color="#e2e2e2", linewidth=0.5)  # type: ignore[arg-type]
    axes.set_axisbelow(True)
