"""What is the same in one episode's recording after another: made once a process, and only sent again.

Converting colours, outlines and layouts for Rerun costs more than an episode of ten actions does afterwards.
"""

from collections.abc import Callable, Hashable, Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rerun as rr

_KEPT: "dict[Hashable, StillEntities]" = {}
_KEEP = 64
"""Each goal of a site has an entry, of some 0.2 MB."""


class StillEntities:
    """Entities as Rerun takes them; `log` is a stream's, so that what logs into one can be kept here instead."""

    def __init__(self) -> None:
        self._entities: list[tuple[str, list[rr.DescribedComponentBatch], bool]] = []

    def log(
        self,
        entity: str,
        *parts: "rr.AsComponents | Iterable[rr.DescribedComponentBatch]",
        static: bool = False,
    ) -> None:
        """Keep what an entity looks like."""
        import rerun as rr

        batches = [
            batch
            for part in parts
            for batch in (part.as_component_batches() if isinstance(part, rr.AsComponents) else part)
        ]
        self._entities.append((entity, batches, static))

    def send(self, stream: "rr.RecordingStream") -> None:
        """Log everything into a stream."""
        for entity, batches, static in self._entities:
            stream.log(entity, batches, static=static)


def still_entities(key: Hashable, draw: Callable[[StillEntities], None]) -> StillEntities:
    """Return what `draw` logs; the last few are kept, by a key that says all that it depends on."""
    known = _KEPT.get(key)
    if known is None:
        while len(_KEPT) >= _KEEP:
            _KEPT.pop(next(iter(_KEPT)), None)
        known = StillEntities()
        draw(known)
        _KEPT[key] = known
    return known
