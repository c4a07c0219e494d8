"""Cache of Rerun entities that many recordings share.

Converting colours, outlines and layouts for Rerun takes longer than logging an episode of ten actions.
"""

from collections.abc import Callable, Hashable, Iterable

import rerun as rr

_CACHE: "dict[Hashable, StaticEntities]" = {}
_MAX_CACHED = 64
"""Each goal of a site has an entry of about 0.2 MB."""


class StaticEntities:
    """Entities converted for Rerun. Has the `log` method of a stream, so that code for streams can fill it."""

    def __init__(self) -> None:
        self._entities: list[tuple[str, list[rr.DescribedComponentBatch], bool]] = []

    def log(
        self,
        entity: str,
        *parts: rr.AsComponents | Iterable[rr.DescribedComponentBatch],
        static: bool = False,
    ) -> None:
        """Store an entity."""
        batches = [
            batch
            for part in parts
            for batch in (part.as_component_batches() if isinstance(part, rr.AsComponents) else part)
        ]
        self._entities.append((entity, batches, static))

    def send(self, stream: rr.RecordingStream) -> None:
        """Log all entities to a stream."""
        for entity, batches, static in self._entities:
            stream.log(entity, batches, static=static)


def cached_entities(key: Hashable, draw: Callable[[StaticEntities], None]) -> StaticEntities:
    """Return what `draw` logs, from the cache if possible. The key must contain everything that `draw` depends on."""
    entities = _CACHE.get(key)
    if entities is None:
        while len(_CACHE) >= _MAX_CACHED:
            _CACHE.pop(next(iter(_CACHE)), None)
        entities = StaticEntities()
        draw(entities)
        _CACHE[key] = entities
    return entities
