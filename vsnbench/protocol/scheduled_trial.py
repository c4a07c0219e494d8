"""A trial in the schedule of a study."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ScheduledTrial:
    """A scheduled trial."""

    rank: int
    """From 0."""
    block: int
    """From 0: every arm once on one cell; in other orders the number of the cell."""
    arm: str
    goal: str
    start: int
    repetition: int

    @property
    def words(self) -> str:
        """Goal, starting position and repetition as text."""
        return f"{self.goal} from {self.start}" + (f", repetition {self.repetition}" if self.repetition > 1 else "")
