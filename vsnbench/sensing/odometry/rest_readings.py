"""Noise and mean pose of the odometry of a base at rest."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from vsnbench.control.standstill import QUIET, NoiseMeter, StandstillNoise, is_quiet, mean_pose, noise_of, readings_for
from vsnbench.values.pose import Pose

ROLL_OUT_S = 0.5
"""Time after which a base with zero velocity is at rest."""
START_SHARE = 0.45
"""Share of the tolerance that the error of a start may use."""
_KEPT = 100
_NOISE_SPAN = 6.0
"""Largest difference of two readings at rest, in standard deviations."""
_FEW = 4
_ENOUGH = 20
"""Number of readings from which noise is measured; fewer can only show that there is none."""


@dataclass(frozen=True, slots=True)
class Start:
    """Start of a movement: the newest odometry of a quiet base, or the mean of several readings of a noisy base."""

    pose: Pose
    noise: StandstillNoise
    readings: int

    def error(self, *, turns: bool) -> float:
        """Return the standard error of the pose along the movement."""
        return self.noise.along(turns=turns) / math.sqrt(self.readings)


@dataclass(frozen=True, slots=True)
class Stillness:
    """Largest change of the odometry of a base at rest."""

    position_m: float = 0.001
    heading_rad: float = math.radians(0.05)

    @classmethod
    def of(cls, poses: Sequence[Pose]) -> "Stillness":
        """Return the limits for `poses` at rest; a base with very large noise was not at rest."""
        noise, quiet = noise_of(poses), cls()
        return cls(
            quiet.position_m + min(_NOISE_SPAN * noise.position_m, 10 * quiet.position_m),
            quiet.heading_rad + min(_NOISE_SPAN * noise.heading_rad, 10 * quiet.heading_rad),
        )


class RestReadings:
    """Collects the readings of a base at rest; not thread-safe."""

    def __init__(self) -> None:
        self._readings: deque[tuple[float, Pose]] = deque(maxlen=_KEPT)
        self.from_s = -math.inf
        """Time from which the base is at rest; infinite while it is commanded to move."""
        self._meter = NoiseMeter()
        self._measured = False

    def moves(self) -> None:
        """Record that the base is commanded to move from now on."""
        if not self._measured:
            self._meter.add(self.poses)
        self._measured = True
        self.from_s = math.inf

    def forget(self) -> None:
        """Drop all readings, because the odometry jumped."""
        self._readings.clear()

    def rests(self, from_s: float) -> None:
        """Record that the base is at rest from `from_s` on."""
        self.from_s, self._measured = from_s, False
        while self._readings and self._readings[0][0] < from_s:
            self._readings.popleft()

    def add(self, pose: Pose, stamp_s: float) -> None:
        """Add a reading."""
        self._readings.append((stamp_s, pose))

    @property
    def poses(self) -> Sequence[Pose]:
        """Readings since the base is at rest."""
        return [pose for at_s, pose in self._readings if at_s >= self.from_s]

    def _is_measured(self, poses: Sequence[Pose]) -> bool:
        """Measure the noise; drop the older readings if the base was moved meanwhile, for example by hand."""
        known = self._meter.freedom
        self._meter.add(poses)
        if self._meter.freedom > known:
            return True
        self._meter.add(poses[-_ENOUGH:])
        if self._meter.freedom == known:
            return False
        self.rests(self._readings[-_ENOUGH][0])
        return True

    def mean(self, latest: Pose) -> Pose:
        """Return the mean of the newest readings at rest; the latest reading of a base with too few."""
        poses = self.poses[-_ENOUGH:]
        return mean_pose(poses) if len(poses) >= _FEW else latest

    def start(
        self,
        latest: Pose,
        tolerance: float,
        *,
        turns: bool,
        holds_heading: bool,
        heading_tolerance_rad: float | None = None,
        final: bool = False,
    ) -> Start | None:
        """Return the start of a movement; None while more readings are needed.

        Args:
            latest: newest odometry.
            tolerance: tolerance of the movement.
            turns: whether the movement is a turn.
            holds_heading: whether the target of a turn does not depend on the start.
            heading_tolerance_rad: tolerance of the turns that will be relative to the heading of this start, if any.
                The first movement that holds a heading, even a move, decides how well all turns after it are known.
            final: whether to use the available readings.
        """
        poses = self.poses
        if not self._measured and len(poses) >= _ENOUGH:
            self._measured = self._is_measured(poses)
            poses = self.poses
        if not self._meter.freedom:
            if final or (
                len(poses) >= _FEW - 1 and self._seem_quiet(poses[1 - _FEW :], tolerance, heading_tolerance_rad, turns)
            ):
                return Start(latest, noise_of(poses) if final else QUIET, 1)
            return None
        noise = self._meter.bound
        needed = [] if turns and holds_heading else [(noise.along(turns=turns), tolerance)]
        if heading_tolerance_rad is not None:
            needed.append((noise.heading_rad, heading_tolerance_rad))
        noisy = [(spread, limit) for spread, limit in needed if not is_quiet(spread, limit)]
        if not noisy and is_quiet(noise.along(turns=turns), tolerance):
            return Start(latest, noise, 1)
        count = max((min(readings_for(spread, START_SHARE * limit), _KEPT) for spread, limit in noisy), default=1)
        if len(poses) < count and not final:
            return None
        return Start(mean_pose(poses) if poses else latest, noise, max(len(poses), 1))

    @staticmethod
    def _seem_quiet(poses: Sequence[Pose], tolerance: float, heading_tolerance_rad: float | None, turns: bool) -> bool:
        """Return whether the newest readings, too few to measure noise, show none."""
        turned = [pose.heading_rad for pose in poses]
        limits = [(turned if turns else [pose.distance_to(poses[0]) for pose in poses], tolerance)]
        if heading_tolerance_rad is not None:
            limits.append((turned, heading_tolerance_rad))
        return all(is_quiet(max(span) - min(span), limit) for span, limit in limits)
