"""What killed runs left in the results directory: cleared away when the next run begins."""

import contextlib
import os
from functools import partial
from pathlib import Path

from vsnbench.database.journal import Journal
from vsnbench.database.queries import images_directories
from vsnbench.errors import RecordError
from vsnbench.record.arrivals import sweep_arrivals
from vsnbench.record.images import depth_path, rgb_path
from vsnbench.record.results import ResultsDirectory
from vsnbench.whole_files import PART, sweep_part_directory, sweep_parts


def sweep_results(results: ResultsDirectory, journal: Journal) -> None:
    """Remove half-written files, what a merge was bringing in, and the images of steps that were never committed.

    What a live process is writing stays; so does every image of a committed step. Only the folders of interrupted
    episodes are searched to their bottom: 10,000 episodes take 0.1 s.
    """
    sweep_arrivals(results.path, partial(images_directories, journal.engine))
    with contextlib.suppress(OSError), os.scandir(results.path / "episodes") as folders:
        for folder in folders:
            if folder.name.endswith(PART):
                sweep_part_directory(Path(folder.path))
            else:
                sweep_parts(Path(folder.path))
    for episode in journal.interrupted():
        try:
            directory = results.episode_directory(episode.images_directory)
        except RecordError:
            continue  # it leads out of the results directory: not ours to clear
        sweep_parts(directory, below=True)
        leftovers = [directory / f"episode.rrd{PART}"]
        if not episode.steps:
            leftovers.append(directory / "trajectory.tum")
        # A run loses one step at most, whose images were in place before it was committed; a merge that was killed
        # all of an episode's.
        lost = episode.steps + 1
        while rgb_path(directory, lost).is_file() or depth_path(directory, lost).is_file():
            leftovers += [rgb_path(directory, lost), depth_path(directory, lost)]
            lost += 1
        for path in leftovers:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
