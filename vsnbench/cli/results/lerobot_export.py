"""Chooses the episodes of `vsnbench export lerobot` and writes the dataset."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vsnbench.cli.support.progress import ProgressBars
from vsnbench.errors import UsageError
from vsnbench.interop.episodes import read_episodes
from vsnbench.interop.lerobot.dataset import require_empty, require_libraries, write_dataset
from vsnbench.interop.lerobot.frames import NOT_EXPORTABLE, frames_of
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.queries import episode_steps
from vsnbench.results.schema.migrate import open_record
from vsnbench.text.sanitize import counted

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LeRobotSummary:
    """What was written."""

    episodes: int
    frames: int
    left_out: dict[int, str]
    """Number of an episode -> code of the reason."""


def export_lerobot(
    results: ResultsDirectory,
    directory: Path,
    numbers: Sequence[int] = (),
    models: Sequence[str] = (),
    goals: Sequence[str] = (),
    *,
    with_depth: bool,
) -> LeRobotSummary:
    """Write a dataset of the chosen episodes; empty choices leave no episode out.

    Raises:
        UsageError: no episode can be exported, the directory is not empty, or the episodes do not fit together.
        RecordError: a file cannot be read or written.
    """
    require_libraries()
    require_empty(directory)
    usable, left_out = [], dict[int, str]()
    with ProgressBars() as progress:
        with open_record(results.database_url) as engine:
            episodes = read_episodes(engine, numbers, models, goals)
            for done, episode in enumerate(episodes):
                progress.show("episodes", done, len(episodes))
                try:
                    steps = episode_steps(engine, episode.id)
                    usable.append(frames_of(episode, steps, results.path, with_depth=with_depth))
                except UsageError as error:
                    if error.code not in NOT_EXPORTABLE:
                        raise
                    logger.warning("%s: left out", error.statement)
                    left_out[episode.id] = error.code
        if not usable:
            codes = sorted(set(left_out.values()))
            raise UsageError(
                f"none of {counted(len(left_out), 'episode')} can be exported",
                advice="record with --keep images or all, and judge with `vsnbench judge`",
                code=codes[0] if len(codes) == 1 else "no-episode",
            )
        write_dataset(usable, directory, partial(progress.show, "frames"))
    return LeRobotSummary(len(usable), sum(map(len, usable)), left_out)
