"""Compares the files of every episode with the rows that describe them."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sqlalchemy import Row

from vsnbench.errors import RecordError
from vsnbench.evidence.verification.checks import Check, Finding, Progress, finding
from vsnbench.evidence.verification.record import VerifiedRecord
from vsnbench.protocol.judge import EndReason
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.directory import DATABASE_NAME, ResultsDirectory
from vsnbench.results.files.film import FILM, StampedPose
from vsnbench.results.files.image_set import expected_images, image_faults
from vsnbench.results.files.images import trajectory_text
from vsnbench.results.merging.episodes import step_digests
from vsnbench.results.schema.row_encoding import pose_of_columns
from vsnbench.results.writing.deletion import unfinished_directories
from vsnbench.results.writing.lifecycle import ENDED
from vsnbench.values.step import lasted_s

TRAJECTORY = "trajectory.tum"
_RERUN_COPY = "episode.rrd"
_EPISODES = "episodes"
_OWN = frozenset({DATABASE_NAME, f"{DATABASE_NAME}-wal", f"{DATABASE_NAME}-shm"})


def check_files(record: VerifiedRecord, progress: Progress) -> Check:
    """Compare every image and trajectory with its row, and find files that no row describes."""
    check = Check("files", "files")
    with check.failing("the record"):
        episodes = record.episodes()
        for done, episode in enumerate(episodes, start=1):
            if not episode.images_directory:
                check.skip("no images kept (episodes)")
            elif episode.state not in ENDED:
                check.skip("not ended (episodes)")
            else:
                with check.failing(f"episode {episode.id}"):
                    _check_episode(record, episode, check)
            progress("reading images", done, len(episodes))
        _check_others(record.results, {episode.images_directory for episode in episodes}, check)
    return check


def _check_episode(record: VerifiedRecord, episode: Row[Any], check: Check) -> None:
    named = episode.images_directory
    directory = confined(record.results, named)
    top = record.results / named
    if linked := next(
        (folder for folder in (top, top / "rgb", top / "depth", top / FILM) if folder.is_symlink()), None
    ):
        check.fail(str(linked.relative_to(record.results)), "is a link, and vsnbench writes none")
        return
    if not top.is_dir():
        check.fail(named, "is missing: the images and the trajectory of the episode")
        return
    digests = step_digests(record.connection, episode.id)
    expected = list(expected_images(digests))
    faults = {fault.file: fault for fault in image_faults(directory, digests, read=True, decode=True)}
    for image in expected:
        fault = faults.get(image.file)
        check.add([] if fault is None else [finding(f"{named}/{image.file}", str(fault.damage))])
        if fault is None and image.file_digest is None:
            check.skip("bytes of an image: recorded without a digest of the file")
    check.add(list(_trajectory_findings(record, episode)))
    described = {image.file for image in expected} | {Path(TRAJECTORY)}
    for file, is_regular in _files_below(top):
        if file in described:
            continue
        if file == Path(_RERUN_COPY) and is_regular:
            check.skip("copy for Rerun, which `vsnbench view` makes again from the images")
        elif not is_regular or episode.end_reason != EndReason.INTERRUPTED:  # a killed process leaves the last image
            check.fail(f"{named}/{file}", "no row describes it" if is_regular else "is not a regular file")


def _trajectory_findings(record: VerifiedRecord, episode: Row[Any]) -> Iterator[Finding]:
    where = f"{episode.images_directory}/{TRAJECTORY}"
    content = read_confined(record.results / episode.images_directory, TRAJECTORY)
    if content is None:
        if episode.end_reason != EndReason.INTERRUPTED:
            yield finding(where, "is missing")
        return
    start = pose_of_columns(episode.start_x_m, episode.start_y_m, episode.start_heading_rad)
    steps = record.steps(episode.id)
    if start is None or any(step.world is None or step.stamp_s is None for step in steps):
        return
    path = [StampedPose((steps[0].stamp_s or 0.0) if steps else 0.0, start)]
    for step in steps:
        if step.world is not None:
            stamp_s = step.stamp_s or 0.0
            path.append(StampedPose(stamp_s + lasted_s(stamp_s, step.result, step.answer), step.world.pose))
    lines, given = trajectory_text(path).splitlines(), content.decode("utf-8", "replace").splitlines()
    if content != trajectory_text(path).encode():
        place = next((n for n, pair in enumerate(zip(lines, given, strict=False), 1) if pair[0] != pair[1]), len(lines))
        yield finding(where, f"line {place} is not the pose in table step")


def _files_below(top: Path, below: Path = Path()) -> Iterator[tuple[Path, bool]]:
    """Yield the files of an episode with whether they are regular ones; links are not followed."""
    with os.scandir(top / below) as entries:
        for entry in sorted(entries, key=lambda found: found.name):
            if entry.is_dir(follow_symlinks=False):
                if below == Path() and entry.name in ("rgb", "depth", FILM):
                    yield from _files_below(top, below / entry.name)
                else:
                    yield below / entry.name, False
            else:
                yield below / entry.name, entry.is_file(follow_symlinks=False)


def _check_others(results: Path, known: set[str], check: Check) -> None:
    """Report directories of episodes without a row, and count files that have no digest."""
    try:
        with os.scandir(results) as entries:
            for entry in entries:
                if entry.name not in (*_OWN, _EPISODES):
                    check.skip(f"{entry.name} in the results directory: no row describes it")
        unfinished, finishing = unfinished_directories(results), ResultsDirectory.locate(results).options
        with os.scandir(results / _EPISODES) as entries:
            for name in {f"{_EPISODES}/{entry.name}" for entry in entries} - known:
                if name in unfinished:  # their rows are gone, so the record is complete without them
                    check.skip(
                        "directory that an interrupted `vsnbench db delete` left; "
                        f"`vsnbench episodes list{finishing}` finishes the deletion"
                    )
                else:
                    check.fail(name, "no episode of the record has it")
    except FileNotFoundError:
        return
    except OSError as error:
        raise RecordError(f"cannot read {results}: {error.strerror or error}") from error
