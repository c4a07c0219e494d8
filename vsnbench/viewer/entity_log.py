"""Two ways into a Rerun stream for what changes with every step: as it happens, or many steps at a time.

A value of one entity at one moment costs Rerun's Python some 0.1 ms, a column of 60 of them little more. So a file that
nobody reads yet is written in columns, and only a viewer that shows an episode live is told of each step.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from vsnbench.viewer.blueprint import TIMELINE

if TYPE_CHECKING:
    import rerun as rr

ROBOT_TIME = "robot_time"
ROWS_AT_ONCE = 64
"""Steps that are held back at most: some 6 MB of images."""


class EntityLog(Protocol):
    """A Rerun stream, at one moment of an episode after another."""

    @property
    def stream(self) -> "rr.RecordingStream":
        """For what is said once, outside time."""
        ...

    def at(self, step: int, robot_time_s: float | None) -> None:
        """Set the moment of what follows; the robot's time stays what it was when None."""
        ...

    def put(self, entity: str, archetype: type["rr.AsComponents"], **components: Sequence[Any]) -> None:
        """Say what an entity looks like from this moment on, each component as a list of its instances."""
        ...

    def send(self) -> None:
        """Hand over everything that was put."""
        ...


class AsItHappens:
    """Logs every value at once."""

    def __init__(self, stream: "rr.RecordingStream") -> None:
        self.stream = stream

    def at(self, step: int, robot_time_s: float | None) -> None:
        """Set the moment of what follows."""
        _set_time(self.stream, step, robot_time_s)

    def put(self, entity: str, archetype: Any, **components: Sequence[Any]) -> None:
        """Log."""
        self.stream.log(entity, archetype.from_fields(**components))

    def send(self) -> None:
        """Do nothing: nothing is held back."""


@dataclass(slots=True)
class _Rows:
    steps: list[int] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    components: dict[str, list[Sequence[Any]]] = field(default_factory=lambda: defaultdict(list))


class InColumns:
    """Holds values back, and sends them as columns of `ROWS_AT_ONCE` steps."""

    def __init__(self, stream: "rr.RecordingStream") -> None:
        self.stream = stream
        self._step = 0
        self._robot_time_s: float | None = None
        self._rows: dict[tuple[str, Any, tuple[str, ...]], _Rows] = defaultdict(_Rows)
        self._held = 0

    def at(self, step: int, robot_time_s: float | None) -> None:
        """Set the moment of what follows."""
        if self._held >= ROWS_AT_ONCE:
            self.send()
        self._held += 1
        self._step = step
        self._robot_time_s = self._robot_time_s if robot_time_s is None else robot_time_s
        _set_time(self.stream, step, robot_time_s)

    def put(self, entity: str, archetype: Any, **components: Sequence[Any]) -> None:
        """Hold a value back; without a robot's time there is no row for it, and it is logged."""
        if self._robot_time_s is None:
            self.stream.log(entity, archetype.from_fields(**components))
            return
        rows = self._rows[entity, archetype, tuple(components)]
        rows.steps.append(self._step)
        rows.times_s.append(self._robot_time_s)
        for name, instances in components.items():
            rows.components[name].append(instances)

    def send(self) -> None:
        """Send what is held back."""
        import rerun as rr

        for (entity, archetype, _), rows in self._rows.items():
            times = [
                rr.TimeColumn(TIMELINE, sequence=rows.steps),
                rr.TimeColumn(ROBOT_TIME, duration=rows.times_s),
            ]
            columns = [
                column for name, values in rows.components.items() for column in _columns(archetype, name, values)
            ]
            self.stream.send_columns(entity, times, columns)
        self._rows.clear()
        self._held = 0


def _columns(archetype: Any, name: str, rows: Sequence[Sequence[Any]]) -> "list[rr.ComponentColumn]":
    columns = archetype.columns(**{name: [instance for row in rows for instance in row]})
    return list(columns.partition([len(row) for row in rows]))


def _set_time(stream: "rr.RecordingStream", step: int, robot_time_s: float | None) -> None:
    stream.set_time(TIMELINE, sequence=step)
    if robot_time_s is not None:
        stream.set_time(ROBOT_TIME, duration=robot_time_s)
