"""Colours of models and outcomes, in figures, pages, videos and Rerun: distinct for colour-blind readers."""

from typing import Final

COLORS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7A6A00", "#000000")
"""Colours of Okabe and Ito for models, ordered so that neighbours differ most; the yellow is darkened for white paper.

Models have them in the order of their first campaigns."""
SUCCESS, FAILURE, COLLISION, LIMIT = "#0072B2", "#D55E00", "#000000", "#CC79A7"
"""Colours of outcomes: success, STOP too far away, collision, action limit."""
VOID: Final = "#826414"
"""Colour of an episode without a result."""

_LIGHT = {"success": "#005A8F", "failure": "#9C3D00", "void": "#6B5200", "on-outcome": "#FFFFFF"}
"""Tones of outcomes that are readable as text, and of text on them; WCAG 2 AA."""
_DARK = {"success": "#7CC4F2", "failure": "#F2A46F", "void": "#E3C46A", "on-outcome": "#10161A"}
_DARK_COLORS = ("#4DA6DB", "#F2853D", "#2FC49A", "#E29BC4", "#8ACBEF", "#F0B840", "#C4B23C", "#FFFFFF")
"""`COLORS` on a dark ground."""


def rgb(color: str) -> tuple[int, int, int]:
    """Return the parts of a colour such as `#0072B2`, each 0 to 255."""
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def css_variables() -> str:
    """Return the colours as CSS variables: `--success` and its like, and `--model-1` to `--model-8`.

    They follow the colour scheme of the reader's system, and `data-theme` of the document where it is set.
    """
    light, dark = (
        "".join(f"--{name}:{color};" for name, color in tones.items())
        + "".join(f"--model-{number}:{color};" for number, color in enumerate(colors, start=1))
        for tones, colors in ((_LIGHT, COLORS), (_DARK, _DARK_COLORS))
    )
    return (
        f":root{{{light}}}\n"
        f'@media (prefers-color-scheme:dark){{:root:not([data-theme="light"]){{{dark}}}}}\n'
        f':root[data-theme="dark"]{{{dark}}}\n'
    )
