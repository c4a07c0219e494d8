"""Rich's console with sanitized text."""

from collections.abc import Iterator
from typing import IO, Any

import rich.console
from rich.segment import Segment

from vsnbench.text.sanitize import without_controls


class Console(rich.console.Console):
    """Rich's console for text of unknown origin: only rich itself writes control codes.

    It sanitizes text before rich adds colors and cursor movements, and so writes to the stream below `SanitizedStream`.
    """

    @property
    def file(self) -> IO[str]:
        """The stream below the sanitized one."""
        stream: Any = super().file
        stream = getattr(stream, "rich_proxied_file", stream)  # rich's own proxy, while a live display runs
        unsanitized: IO[str] = getattr(stream, "unsanitized", stream)
        return unsanitized

    @file.setter
    def file(self, new_file: IO[str]) -> None:
        rich.console.Console.file.fset(self, new_file)  # type: ignore[attr-defined]

    def render(
        self, renderable: rich.console.RenderableType, options: rich.console.ConsoleOptions | None = None
    ) -> Iterator[Segment]:
        """Yield the segments of a renderable, sanitized."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(without_controls(segment.text), segment.style)
