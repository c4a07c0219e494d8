"""Which images make one observation: all taken after the motion ended, colour and depth close in time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

Payload = TypeVar("Payload")


@dataclass(frozen=True, slots=True, eq=False)
class Stamped(Generic[Payload]):
    """A message, when it was taken (sender's clock) and when it arrived (our monotonic clock)."""

    payload: Payload
    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True)
class MotionEnd:
    """When the last motion was over, on the robot's clock and on ours; images must be younger by both."""

    stamp_s: float
    arrival_s: float


@dataclass(frozen=True, slots=True, eq=False)
class MatchedImages(Generic[Payload]):
    """One colour image, and the depth images that one depth is filtered from."""

    color: Stamped[Payload]
    depths: tuple[Stamped[Payload], ...]

    @property
    def skew_s(self) -> float:
        """Colour stamp minus the newest depth stamp; 0 without depth."""
        return self.color.stamp_s - self.depths[-1].stamp_s if self.depths else 0.0


def frames_after(frames: Sequence[Stamped[Payload]], end: MotionEnd) -> list[Stamped[Payload]]:
    """Return the frames that were taken after the motion ended, in the order in which they came."""
    return [frame for frame in frames if frame.stamp_s > end.stamp_s and frame.arrival_s > end.arrival_s]


def match_images(
    colors: Sequence[Stamped[Payload]],
    depths: Sequence[Stamped[Payload]],
    end: MotionEnd,
    depth_frames: int,
    max_skew_s: float,
) -> MatchedImages[Payload] | None:
    """Return the newest complete match, or None while images are still missing.

    Args:
        colors: the last colour images, oldest first.
        depths: the last depth images, oldest first.
        end: when the last motion ended.
        depth_frames: how many depth images one observation needs; 0 for a robot without depth.
        max_skew_s: the colour image must be this close to the newest depth image.
    """
    fresh_colors = frames_after(colors, end)
    if not fresh_colors:
        return None
    if depth_frames == 0:
        return MatchedImages(fresh_colors[-1], ())
    fresh_depths = frames_after(depths, end)[-depth_frames:]
    if len(fresh_depths) < depth_frames:
        return None
    newest_s = fresh_depths[-1].stamp_s
    match = MatchedImages(min(fresh_colors, key=lambda frame: abs(frame.stamp_s - newest_s)), tuple(fresh_depths))
    return match if abs(match.skew_s) <= max_skew_s else None
