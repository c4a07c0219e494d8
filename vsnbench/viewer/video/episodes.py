"""Videos of one episode, of two side by side, and of many in a grid."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.files.mp4 import write_mp4
from vsnbench.viewer.replay import EpisodeReplay
from vsnbench.viewer.video.canvas import Area, FrameCanvas, Image
from vsnbench.viewer.video.panel import EpisodePanel, PanelStyle

SIZES = {"talk": (1280, 720), "web": (854, 480)}
"""Width and height in pixels by use; the larger one for slides, the smaller one for a page or a message."""
MAX_IN_GRID = 36
END_S = 2.0
"""Time for which the end is shown."""


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """Size and speed of a video."""

    size: tuple[int, int] = SIZES["talk"]
    actions_per_s: float = 4.0


def write_video(
    replays: Sequence[EpisodeReplay],
    path: Path,
    wanted: VideoFormat | None = None,
    progress: Callable[[int, int], object] = lambda _done, _of: None,
) -> int:
    """Write one video of these episodes: one fills the frame, two are side by side, more form a grid.

    All of them begin together, with one action per frame.

    Returns:
        The number of frames.

    Raises:
        UsageError: an episode has no images, there are too many, or PyAV is missing.
        RecordError: the file cannot be written.
    """
    chosen = wanted or VideoFormat()
    if not 1 <= len(replays) <= MAX_IN_GRID:
        raise UsageError(
            f"a grid shows at most {MAX_IN_GRID} episodes, not {len(replays)}",
            advice="choose fewer, for instance with --goal",
            code="too-many-episodes",
        )
    panels = _panels(replays, *chosen.size)
    frames = max(panel.frames for panel in panels) - 1 + max(1, round(END_S * chosen.actions_per_s))

    def drawn() -> Iterator[Image]:
        for number in range(frames):
            canvas = FrameCanvas(*chosen.size)
            for panel in panels:
                panel.draw(canvas, number)
            yield canvas.pixels()
            progress(number + 1, frames)

    return write_mp4(drawn(), path, chosen.actions_per_s)


def _seen(width: int, height: int, count: int, columns: int) -> float:
    """Return the width of an image of 4:3 in a grid with this number of columns, pixels."""
    return min(width / columns, height / math.ceil(count / columns) * 4 / 3)


def _panels(replays: Sequence[EpisodeReplay], width: int, height: int) -> list[EpisodePanel]:
    count, text = len(replays), max(11, round(height / 40))
    columns = count if count <= 2 else max(range(1, count + 1), key=partial(_seen, width, height, count))
    cell = width // columns, height // math.ceil(count / columns)
    if count <= 2:
        style, margin = PanelStyle(text if count == 1 else round(text * 0.8)), 0
    else:
        style, margin = PanelStyle(max(9, round(min(cell) / 16)), details=False), 2
    return [
        EpisodePanel(replay, Area(place % columns * cell[0], place // columns * cell[1], *cell).inset(margin), style)
        for place, replay in enumerate(replays)
    ]
