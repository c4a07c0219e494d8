"""Odometry from TF: the pose of a base frame in an odometry frame."""

import math
import threading
from collections.abc import Iterable
from dataclasses import dataclass

from vsnbench.sensing.odometry.odometry import PlanarReading, heading_of_quaternion

_MOST_FRAMES = 2000
_MOST_NAMED = 8
TF_ADVICE = "start the node that publishes the missing link, or correct the frames in the profile (interface.tf)"
"""Advice for frames that give no odometry."""
_STALE_S = 1.0
"""Largest difference between the stamps of moving links in one pose."""

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Link:
    """One transform: the pose of a child frame in its parent frame; metres, and a quaternion x, y, z, w."""

    parent: str
    child: str
    stamp_s: float
    translation_m: Vector
    rotation: Quaternion


class TransformChain:
    """Composes the links of TF between two frames; thread-safe."""

    def __init__(self, odom_frame: str, base_frame: str) -> None:
        self._odom_frame = odom_frame
        self._base_frame = base_frame
        self._lock = threading.Lock()
        self._links: dict[str, Link] = {}
        self._fixed: set[str] = set()
        self._last_stamp_s = math.nan

    def add(self, links: Iterable[Link], *, fixed: bool) -> PlanarReading | None:
        """Add the links of one message.

        Args:
            links: the transforms.
            fixed: whether they are from the topic of fixed links.

        Returns:
            The pose of the base, with the stamp of the first moving link below the odometry frame; None unless that
            stamp is new and all other links are known.
        """
        with self._lock:
            received = set()
            for link in links:
                if link.child not in self._links and len(self._links) >= _MOST_FRAMES:
                    continue
                self._links[link.child] = link
                received.add(link.child)
                (self._fixed.add if fixed else self._fixed.discard)(link.child)
            chain = self._chain()
            odometry = self._odometry_link(chain)
            if odometry is None or odometry.child not in received or odometry.stamp_s == self._last_stamp_s:
                return None
            if self._stale(chain, odometry) is not None:
                return None
            self._last_stamp_s = odometry.stamp_s
            return pose_of(chain, odometry.stamp_s)

    def fault(self) -> str:
        """Return why the frames give no odometry, or an empty string."""
        with self._lock:
            chain = self._chain()
            if not chain:
                return self._disconnected()
            odometry = self._odometry_link(chain)
            if odometry is None:
                return f"TF: every link from {self._odom_frame} to {self._base_frame} is fixed, so none is odometry"
            stale = self._stale(chain, odometry)
            if stale is not None:
                age_s = odometry.stamp_s - stale.stamp_s
                return f"TF: {_link_text(stale)} is {age_s:.1f} s older than {_link_text(odometry)}"
            return ""

    def _chain(self) -> list[Link]:
        """Return the links from the odometry frame down to the base frame; empty if they do not connect."""
        chain: list[Link] = []
        frame, visited = self._base_frame, set()
        while frame != self._odom_frame:
            link = self._links.get(frame)
            if link is None or frame in visited:
                return []
            visited.add(frame)
            chain.append(link)
            frame = link.parent
        return chain[::-1]

    def _odometry_link(self, chain: list[Link]) -> Link | None:
        return next((link for link in chain if link.child not in self._fixed), None)

    def _stale(self, chain: list[Link], odometry: Link) -> Link | None:
        moving = (link for link in chain if link.child not in self._fixed)
        return next((link for link in moving if odometry.stamp_s - link.stamp_s > _STALE_S), None)

    def _disconnected(self) -> str:
        above = [self._ancestors(frame) for frame in (self._odom_frame, self._base_frame)]
        parents = ", ".join(f"{_printable(frames[0])} has {_parents(frames[1:])}" for frames in above)
        if self._base_frame in above[0]:
            return f"TF connects {self._odom_frame} below {self._base_frame}, not above it: {parents}"
        seen = [_link_text(link) for link in list(self._links.values())[:_MOST_NAMED]]
        links = f"links seen: {', '.join(seen)}" if seen else "no link seen"
        return f"TF does not connect {self._odom_frame} to {self._base_frame}: {parents}; {links}"

    def _ancestors(self, frame: str) -> list[str]:
        frames = [frame]
        while (link := self._links.get(frames[-1])) is not None and link.parent not in frames:
            frames.append(link.parent)
        return frames


def pose_of(chain: Iterable[Link], stamp_s: float) -> PlanarReading:
    """Compose links, outermost first; the heading is NaN if a rotation is invalid."""
    position: Vector = (0.0, 0.0, 0.0)
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    for link in chain:
        shift = _rotated(rotation, link.translation_m)
        position = (position[0] + shift[0], position[1] + shift[1], position[2] + shift[2])
        rotation = _product(rotation, _unit(link.rotation))
    return PlanarReading(position[0], position[1], heading_of_quaternion(*rotation), stamp_s, rotation)


def frame_of(name: str) -> str:
    """Return the name of a frame without the leading slash of the older tf."""
    return name.removeprefix("/")


def _unit(rotation: Quaternion) -> Quaternion:
    norm = math.sqrt(sum(part * part for part in rotation))
    if not math.isfinite(norm) or norm < 0.5:
        return (math.nan, math.nan, math.nan, math.nan)
    x, y, z, w = (part / norm for part in rotation)
    return (x, y, z, w)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(rotation: Quaternion, vector: Vector) -> Vector:
    x, y, z, w = rotation
    moved = _product(_product(rotation, (*vector, 0.0)), (-x, -y, -z, w))
    return moved[:3]


def _link_text(link: Link) -> str:
    return f"{_printable(link.parent)} to {_printable(link.child)}"


def _parents(frames: list[str]) -> str:
    if not frames:
        return "no parent"
    names = ", ".join(map(_printable, frames[:_MOST_NAMED]))
    return f"{'parents' if len(frames) > 1 else 'parent'} {names}"


def _printable(frame: str) -> str:
    return "".join(letter for letter in frame[:60] if letter.isprintable())
