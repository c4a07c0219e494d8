"""Exports the steps of episodes as one CSV file."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from vsnbench.files.atomic import atomic_file
from vsnbench.results.model import STEPS_TABLE, Episode
from vsnbench.results.step_fields import STEP
from vsnbench.values.step import StepRecord

OF_STEP = STEP.but("movement", "part", "probabilities", "details")
"""Quantities of a step that fit into cells of a table."""


def write_steps(
    episodes: Sequence[Episode],
    steps_of: Callable[[Episode], Iterable[StepRecord]],
    path: Path,
) -> int:
    """Write the steps of the episodes and return their number; unknown numbers are empty.

    Raises:
        RecordError: the file cannot be written.
    """
    written = 0
    with atomic_file(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*STEPS_TABLE.headings(), *OF_STEP.headings()])
        for episode in episodes:
            about = STEPS_TABLE.cells(episode)
            for step in steps_of(episode):
                writer.writerow([*about, *OF_STEP.cells(step)])
                written += 1
    return written
