"""Chooses the episodes of `vsnbench export video`, names the files and writes them."""

import logging
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vsnbench.cli.support.progress import ProgressBars
from vsnbench.errors import UsageError, VsnbenchError
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.reading.filtering import EpisodeFilter
from vsnbench.results.reading.queries import list_episodes
from vsnbench.results.schema.migrate import open_record
from vsnbench.text.sanitize import counted
from vsnbench.viewer.replay import read_episode
from vsnbench.viewer.video.episodes import SIZES, VideoFormat, write_video

logger = logging.getLogger(__name__)
_DIRECTORY = Path("videos")


@dataclass(frozen=True, slots=True)
class VideoRequest:
    """Options of the command."""

    numbers: tuple[int, ...]
    models: tuple[str, ...]
    goals: tuple[str, ...]
    only_failures: bool
    pair: bool
    montage: bool
    output: Path | None
    size: str
    actions_per_s: float


def export_videos(results: ResultsDirectory, request: VideoRequest) -> list[Path]:
    """Write the videos and return their files.

    Raises:
        UsageError: options contradict each other, no episode matches, or none of them can become a video.
        RecordError: a file cannot be written.
    """
    if request.size not in SIZES:
        raise UsageError(f"--size {request.size}: unknown size", advice=f"give {' or '.join(SIZES)}")
    wanted = VideoFormat(SIZES[request.size], request.actions_per_s)
    numbers = _chosen(results, request)
    if request.pair or request.montage:
        file = request.output or Path(_joint_name(request, numbers))
        replays = [read_episode(results, number) for number in numbers]
        with ProgressBars() as progress:
            write_video(replays, file, wanted, partial(progress.show, file.name))
        return [file]
    written: list[Path] = []
    with ProgressBars() as progress:
        for number in numbers:
            try:
                file = _file_of(number, request, alone=len(numbers) == 1)
                write_video([read_episode(results, number)], file, wanted, partial(progress.show, file.name))
            except VsnbenchError as error:
                if len(numbers) == 1 or error.code not in ("no-images", "imported-episode"):
                    raise
                logger.warning("%s: left out", error.statement)
                continue
            written.append(file)
    if not written:
        raise UsageError(f"none of {counted(len(numbers), 'episode')} has images", code="no-images")
    return written


def _chosen(results: ResultsDirectory, request: VideoRequest) -> tuple[int, ...]:
    by_options = bool(request.models or request.goals or request.only_failures)
    if request.pair and request.montage:
        raise UsageError("--pair and --montage are different arrangements", advice="leave one of them out")
    if request.numbers and by_options:
        raise UsageError("give episodes by number or by --model, --goal and --failures", advice="leave one of them out")
    if not request.numbers and not by_options:
        raise UsageError(
            "no episodes given", advice="give numbers, or --model, --goal or --failures", code="no-episode"
        )
    numbers = tuple(dict.fromkeys(request.numbers))
    if by_options:
        outcome = "failure" if request.only_failures else ""
        selected = EpisodeFilter(models=request.models, goals=request.goals, outcome=outcome)
        with open_record(results.database_url) as engine:
            found = [episode for episode in list_episodes(engine, selected) if episode.end_reason is not None]
        numbers = tuple(episode.id for episode in sorted(found, key=lambda episode: (episode.goal, episode.start)))
        if not numbers:
            raise UsageError("no episode matches", advice="`vsnbench episodes list` lists the episodes")
    if request.pair and len(numbers) != 2:
        raise UsageError(f"--pair shows two episodes, not {len(numbers)}", advice="like `export video 12 47 --pair`")
    return numbers


def _file_of(number: int, request: VideoRequest, *, alone: bool) -> Path:
    name = f"episode-{number:06d}.mp4"
    if alone and (request.output is None or request.output.suffix.lower() == ".mp4"):
        return request.output or Path(name)
    if request.output is not None and request.output.suffix.lower() == ".mp4":
        raise UsageError(
            f"{request.output} is one file, and there are several videos",
            advice="give a directory, --pair or --montage",
        )
    return (request.output or _DIRECTORY) / name


def _joint_name(request: VideoRequest, numbers: tuple[int, ...]) -> str:
    return f"episodes-{numbers[0]}-{numbers[1]}.mp4" if request.pair else "montage.mp4"
