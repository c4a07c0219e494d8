"""The frames of a recorded episode for a dataset: an observation with its action per step."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vsnbench.errors import UsageError
from vsnbench.interop.episodes import taken_s
from vsnbench.results.files.confined_paths import confined, read_confined
from vsnbench.results.files.images import depth_path, further_images, rgb_path
from vsnbench.results.model import Episode
from vsnbench.values.encoding.images import picture_size
from vsnbench.values.goal import GoalKind
from vsnbench.values.movement import Action
from vsnbench.values.step import StepRecord

CAMERA, DEPTH = "observation.images.camera", "observation.images.depth"
"""Features of the main camera; those of a further one have its role, as `left` and `left_depth`."""
ACTIONS = tuple(Action)
"""Actions by index."""
NOT_EXPORTABLE = frozenset({"unjudged-episode", "no-steps", "no-images", "no-depth", "no-odometry"})
"""Codes of errors for which an episode is left out."""

Floats = npt.NDArray[np.float32]
Sizes = frozenset[tuple[int, int]]


@dataclass(frozen=True, slots=True)
class RecordedImages:
    """Image files of an episode, one of a kind per frame."""

    directory: Path
    numbers: tuple[int, ...]
    """Numbers of the steps."""
    sizes: Sizes
    """Widths and heights in pixels, of all frames."""
    content_bytes: int
    """Size of all files."""
    depth: bool = False
    """Depth instead of colour."""
    role: str = ""
    """Role of a further camera; empty for the main one."""

    def path(self, frame: int) -> Path:
        """Return the file of a frame, from 0, inside the directory."""
        return (depth_path if self.depth else rgb_path)(Path(), self.numbers[frame], self.role)

    def read(self, frame: int) -> bytes:
        """Return the content of a file; empty if it is missing.

        Raises:
            RecordError: it is outside the directory, too large, or cannot be read.
        """
        return read_confined(self.directory, self.path(frame)) or b""


@dataclass(frozen=True, slots=True)
class EpisodeFrames:
    """An episode for a dataset, with N frames."""

    episode: Episode
    task: str
    """What to do, in words."""
    state: Floats
    """(N, 3) odometry at the observation, relative to the start of the episode: x, y in metres, heading in radians."""
    action: Floats
    """(N, 4) what the robot did next, in its own frame at the observation: forward and left in metres, turn in radians,
    and 1 for STOP."""
    discrete_action: npt.NDArray[np.int64]
    """(N,) index in `ACTIONS` of the action that the model chose."""
    blocked: npt.NDArray[np.bool_]
    """(N,) whether the depth guard blocked the action, before or during it."""
    robot_time_s: npt.NDArray[np.float64]
    """(N,) time of the image on the robot's clock, since the first image of the episode."""
    images: Mapping[str, RecordedImages]
    """Colour of each camera, and its depth if that is wanted, by feature."""

    def __len__(self) -> int:
        return len(self.state)


def frames_of(
    episode: Episode, steps: Iterable[StepRecord], results_directory: Path, *, with_depth: bool
) -> EpisodeFrames:
    """Return the frames of an episode.

    Raises:
        UsageError: it cannot be part of a dataset; its code is one of `NOT_EXPORTABLE`.
        RecordError: the record contains a path outside its directory.
    """
    taken = list(steps)
    if episode.success is None:
        raise UsageError(f"episode {episode.id} has no verdict: it is void or not judged", code="unjudged-episode")
    if not taken:
        raise UsageError(f"episode {episode.id} has no steps", code="no-steps")
    if not episode.images_directory:
        raise UsageError(f"episode {episode.id} keeps no images", code="no-images")
    state, action = [], []
    for step in taken:
        before, after = step.observed, step.after
        if before is None or after is None:
            raise UsageError(f"episode {episode.id} has no odometry at step {step.number}", code="no-odometry")
        moved = after.relative_to(before)
        state.append((before.x_m, before.y_m, before.heading_rad))
        action.append((moved.x_m, moved.y_m, moved.heading_rad, float(step.action is Action.STOP)))
    directory = confined(results_directory, episode.images_directory)
    times_s = np.array([taken_s(episode, step) for step in taken])
    return EpisodeFrames(
        episode=episode,
        task=task_text(episode),
        state=np.array(state, np.float32),
        action=np.array(action, np.float32),
        discrete_action=np.array([ACTIONS.index(step.action) for step in taken], np.int64),
        blocked=np.array([step.blocked for step in taken]),
        robot_time_s=times_s - times_s[0],
        images=_images_of_cameras(episode, directory, taken, with_depth=with_depth),
    )


def task_text(episode: Episode) -> str:
    """Return the task in words: an instruction as it is, and "find …" for other goals."""
    if episode.goal_kind == GoalKind.INSTRUCTION:
        return episode.goal_text
    if episode.goal_kind == GoalKind.TEXT:
        return f"find {episode.goal_text}"
    if episode.goal_kind == GoalKind.IMAGE:
        return f"find what the photograph {episode.goal} shows"
    if episode.goal_kind in (GoalKind.POINT, GoalKind.ROUTE, GoalKind.SEQUENCE):
        return f"go to {GoalKind(episode.goal_kind)} {episode.goal}"
    words = (episode.goal_text or episode.goal).replace("_", " ")
    return f"find {'an' if words[:1].lower() in 'aeiou' else 'a'} {words}"


def _images_of_cameras(
    episode: Episode, directory: Path, steps: Sequence[StepRecord], *, with_depth: bool
) -> dict[str, RecordedImages]:
    """Return the images by feature: of the main camera, and of the further ones that the first step has."""
    numbers = tuple(step.number for step in steps)
    found = {CAMERA: _images(episode, directory, numbers, depth=False)}
    if with_depth:
        found[DEPTH] = _images(episode, directory, numbers, depth=True)
    for depth in (False, True) if with_depth else (False,):
        for role in further_images(steps[0].details, depth=depth):
            key = CAMERA.replace("camera", f"{role}_depth" if depth else role)
            found[key] = _images(episode, directory, numbers, depth=depth, role=role)
    return found


def _images(
    episode: Episode, directory: Path, numbers: tuple[int, ...], *, depth: bool, role: str = ""
) -> RecordedImages:
    kind, path_of = ("depth image", depth_path) if depth else ("image", rgb_path)
    sizes, content_bytes = set(), 0
    for number in numbers:
        content = read_confined(directory, path_of(Path(), number, role)) or b""
        size = picture_size(content)
        if size is None:
            statement = f"episode {episode.id} has no {role and f'{role} '}{kind} of step {number}"
            raise UsageError(statement, code="no-depth" if depth else "no-images")
        sizes.add(size)
        content_bytes += len(content)
    return RecordedImages(directory, numbers, frozenset(sizes), content_bytes, depth, role)
