"""Odometry noise of a base at rest, and detection of rest by the mean of a window of noisy readings.

Independent of clocks and robots. Not used for a base whose odometry is quiet at rest.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from vsnbench.values.pose import Pose, wrap_angle

BOUND_ERRORS = 3.5
"""Standard errors between a mean and the bound of the true value. With several tests of one window, the probability
that the bound does not hold is below one in a thousand.
"""
_QUIET_SHARE = 1 / 40
"""Noise below this share of the tolerance cannot change a single reading by `STILL_SHARE`."""
STILL_SHARE = 0.2
"""A base at rest moves less than this share of the tolerance within the settling time."""
_LONGEST_WINDOW_S = 1.5
"""Maximum length of a window; noise that needs a longer one is too large for the tolerance."""
_SHORTEST_WINDOW_S = 0.15
"""Time within which a base that still rolls, because the last command came late, is detected."""
_SMOOTHING_S = 0.3
_MIN_READINGS = 4
_SPREAD_READINGS = 6
"""Minimum number of readings for an estimate of their noise."""
_CORRECTION_SHARE = 0.15
"""Maximum standard error of a mean that is used for a correction, as a share of the tolerance."""
_CORRECTION_READINGS = 14
"""Duration of a correction, in readings."""
_HIGHEST_CORRELATION = _MOTION_CORRELATION = 0.8
_MOTION_READINGS = 10
_ROUNDING = 1e-7
"""Metres or radians: smaller deviations are rounding errors of exact odometry, whose correlation means nothing."""
_REMEMBERED = 200
"""Number of readings after which earlier ones get less weight."""


@dataclass(frozen=True, slots=True)
class StandstillNoise:
    """Standard deviations of the odometry at rest; the mean of n readings has this error divided by sqrt(n)."""

    position_m: float = 0.0
    heading_rad: float = 0.0

    @property
    def heading_deg(self) -> float:
        """Noise of the heading in degrees."""
        return math.degrees(self.heading_rad)

    def along(self, *, turns: bool) -> float:
        """Return the noise of the measurement of a movement: metres of a move, radians of a turn."""
        return self.heading_rad if turns else self.position_m


QUIET = StandstillNoise()


class NoiseMeter:
    """Measures the noise of a base's odometry over several rests; a slow drift within a rest is not noise."""

    def __init__(self) -> None:
        self._axes = (_Spread(), _Spread(), _Spread())

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the axis with the fewest: number of readings minus the parameters of the drifts."""
        return int(min(axis.freedom for axis in self._axes))

    @property
    def noise(self) -> StandstillNoise:
        """Noise of all rests so far."""
        x_m, y_m, heading_rad = (axis.noise for axis in self._axes)
        return StandstillNoise(max(x_m, y_m), heading_rad)

    @property
    def bound(self) -> StandstillNoise:
        """The noise plus its own standard error, since few readings may be quiet by chance."""
        share = 1 + 1 / math.sqrt(2 * self.freedom) if self.freedom else 1.0
        return StandstillNoise(self.noise.position_m * share, self.noise.heading_rad * share)

    def add(self, poses: Sequence[Pose]) -> None:
        """Add the readings of one rest, in order; without the axes on which the base was pushed meanwhile."""
        if len(poses) < _MIN_READINGS:
            return
        rests = [_without_drift(values) for values in zip(*((p.x_m, p.y_m, p.heading_rad) for p in poses), strict=True)]
        for axis, rest in zip(self._axes, rests, strict=True):
            if len(poses) < _MOTION_READINGS or not _is_motion(rest):
                axis.add(rest)


def noise_of(poses: Sequence[Pose]) -> StandstillNoise:
    """Return the noise of consecutive readings of a base at rest."""
    meter = NoiseMeter()
    meter.add(poses)
    return meter.noise


def is_quiet(noise: float, tolerance: float) -> bool:
    """Return whether single readings are accurate enough for a tolerance."""
    return noise <= _QUIET_SHARE * tolerance


def readings_for(noise: float, error: float) -> int:
    """Return the number of readings whose mean has a bound within `error`."""
    return max(math.ceil((BOUND_ERRORS * noise / error) ** 2), _MIN_READINGS)


def too_noisy(noise: float, tolerance: float, aim_share: float, rate_hz: float) -> bool:
    """Return whether no acceptable window can prove that a movement ended within the tolerance."""
    return readings_for(noise, (1 - aim_share) * tolerance) > _LONGEST_WINDOW_S * rate_hz


def noise_words(noise: float, tolerance: float, *, turns: bool) -> str:
    """Return text about noise that is too large for a tolerance."""
    scale, unit = (math.degrees(1), "°") if turns else (1000, " mm")
    return f"odometry noise of {noise * scale:.2g}{unit} at rest is too large for {tolerance * scale:.2g}{unit}"


def mean_pose(poses: Sequence[Pose]) -> Pose:
    """Return the mean of readings whose headings are unwrapped."""
    count = len(poses)
    return Pose(
        sum(pose.x_m for pose in poses) / count,
        sum(pose.y_m for pose in poses) / count,
        sum(pose.heading_rad for pose in poses) / count,
    )


@dataclass(frozen=True, slots=True)
class RestEstimate:
    """Remaining distance of a base at rest: the mean of a window and its standard error."""

    mean: float
    noise: float
    """Standard deviation of one reading."""
    start_error: float
    """Standard error of the pose from which the distance is measured."""
    readings: int

    def within(self, tolerance: float) -> bool:
        """Return whether the true value is within the tolerance, by the bound."""
        return self.readings >= self._readings_for(tolerance)

    def needs_correction(self, tolerance: float) -> bool:
        """Return whether a correction by the mean is faster than the readings that prove the tolerance."""
        known = self.noise / math.sqrt(self.readings) <= _CORRECTION_SHARE * tolerance
        return known and self._readings_for(tolerance) > self.readings + _CORRECTION_READINGS

    def _readings_for(self, tolerance: float) -> float:
        """Return the number of readings with this mean that prove the tolerance; infinity if none can."""
        allowed = max(tolerance - abs(self.mean), 0.0) / BOUND_ERRORS
        if allowed <= self.start_error:
            return math.inf
        return self.noise**2 / (allowed**2 - self.start_error**2)


class RestWindow:
    """Readings of a base since its standstill command.

    Args:
        noise: standard deviation of one reading at rest.
        start_error: standard error of the pose from which the distance is measured.
        tolerance: tolerance of the movement.
    """

    def __init__(self, noise: float, start_error: float, tolerance: float) -> None:
        self._noise = noise
        self._start_error = start_error
        self._tolerance = tolerance
        self._readings: deque[tuple[float, float]] = deque()
        self._from_s = math.inf
        self._last_s = -math.inf

    @property
    def since_s(self) -> float:
        """Time of the first reading of the window; infinity without one."""
        return self._readings[0][0] if self._readings else math.inf

    def restart(self, from_s: float) -> None:
        """Discard all readings and accept those measured from `from_s` on."""
        self._readings.clear()
        self._from_s = from_s

    def add(self, left: float, stamp_s: float) -> RestEstimate | None:
        """Add a reading; return a new estimate if the base is at rest, else None."""
        if stamp_s <= self._last_s or stamp_s < self._from_s:
            return None
        self._last_s = stamp_s
        self._readings.append((stamp_s, left))
        values = [value for _, value in self._readings]
        count = len(values)
        if count < _MIN_READINGS or stamp_s - self.since_s < _SHORTEST_WINDOW_S:
            return None
        noise = self._noise
        spread = _deviation(values)
        if count >= _SPREAD_READINGS and spread > 1.5 * noise:
            noise = spread
        early, late = values[: count // 2], values[count // 2 :]
        drift = abs(sum(early) / len(early) - sum(late) / len(late))
        if drift > STILL_SHARE * self._tolerance + 2 * self._noise * math.sqrt(1 / len(early) + 1 / len(late)):
            self._readings.popleft()
            return None
        return RestEstimate(sum(values) / count, noise, self._start_error, count)


class PathRest:
    """Detects the rest of a base at the end of a path or a velocity, with quiet and with noisy odometry.

    Args:
        noise: noise of the odometry at rest.
        settle_s: time without motion after which a base with quiet odometry is at rest.
        still_m: largest distance of a base at rest.
        still_rad: largest turn of a base at rest.
    """

    def __init__(self, noise: StandstillNoise, settle_s: float, still_m: float, still_rad: float) -> None:
        self._settle_s = settle_s
        self._still_m, self._still_rad = still_m, still_rad
        self._still: tuple[Pose, float] | None = None
        self._windows: tuple[RestWindow, ...] = ()
        if not (is_quiet(noise.position_m, still_m) and is_quiet(noise.heading_rad, still_rad)):
            # A window tolerates a drift of STILL_SHARE of its tolerance.
            self._windows = tuple(
                RestWindow(spread, 0.0, still / STILL_SHARE)
                for spread, still in (
                    (noise.position_m, still_m),
                    (noise.position_m, still_m),
                    (noise.heading_rad, still_rad),
                )
            )

    @property
    def since_s(self) -> float:
        """Time since when the base has been at rest, if noisy readings were averaged; infinity otherwise."""
        return max((window.since_s for window in self._windows), default=math.inf)

    def begin(self, from_s: float) -> None:
        """Use the readings measured from `from_s` on, when the base should be at rest."""
        for window in self._windows:
            window.restart(from_s)

    def add(self, pose: Pose, stamp_s: float) -> bool:
        """Add a reading; return whether the base is at rest."""
        if self._windows:
            values = (pose.x_m, pose.y_m, pose.heading_rad)
            estimates = [window.add(value, stamp_s) for window, value in zip(self._windows, values, strict=True)]
            return all(estimate is not None for estimate in estimates)
        if self._still is not None:
            still, since_s = self._still
            turned_rad = abs(wrap_angle(pose.heading_rad - still.heading_rad))
            if pose.distance_to(still) <= self._still_m and turned_rad <= self._still_rad:
                return stamp_s - since_s >= self._settle_s
        self._still = pose, stamp_s
        return False


class RemainingFilter:
    """Predicts the remaining distance from commands and corrects it slowly by noisy odometry."""

    def __init__(self) -> None:
        self._total: float | None = None
        self._stamp_s = -math.inf

    def remaining(self, measured: float, commanded: float, stamp_s: float) -> float:
        """Return the filtered remaining distance.

        Args:
            measured: the remaining distance by the newest odometry.
            commanded: the distance commanded so far.
            stamp_s: time of measurement of the odometry; each reading counts once.
        """
        if self._total is None:
            self._total = measured + commanded
        elif stamp_s > self._stamp_s:
            share = 1 - math.exp((self._stamp_s - stamp_s) / _SMOOTHING_S)
            self._total += share * (measured + commanded - self._total)
        self._stamp_s = max(stamp_s, self._stamp_s)
        return self._total - commanded


def _without_drift(values: Sequence[float]) -> list[float]:
    """Return the residuals of readings from a line through them."""
    count = len(values)
    middle, mean = (count - 1) / 2, sum(values) / count
    slope = sum((i - middle) * (v - mean) for i, v in enumerate(values)) * 12 / (count * (count * count - 1))
    return [value - mean - slope * (i - middle) for i, value in enumerate(values)]


def _is_motion(rest: Sequence[float]) -> bool:
    """Return whether readings have the correlation of a moving base."""
    squares = sum(value * value for value in rest)
    if squares <= len(rest) * _ROUNDING**2:
        return False
    return sum(a * b for a, b in pairwise(rest)) > _MOTION_CORRELATION * squares


class _Spread:
    """Sums of squared residuals of one axis, and of products of neighbouring residuals."""

    def __init__(self) -> None:
        self._squares = self._products = self.freedom = 0.0

    @property
    def noise(self) -> float:
        """Standard deviation, increased by the correlation of neighbouring readings."""
        if not self._squares or not self.freedom:
            return 0.0
        correlation = self._products / self._squares
        if correlation < 2 / math.sqrt(self.freedom):
            correlation = 0.0
        correlation = min(correlation, _HIGHEST_CORRELATION)
        return math.sqrt(self._squares / self.freedom * (1 + correlation) / (1 - correlation))

    def add(self, rest: Sequence[float]) -> None:
        count = len(rest)
        weight = min(1.0, _REMEMBERED / (self.freedom + 1))
        self._squares = weight * self._squares + sum(value * value for value in rest)
        self._products = weight * self._products + sum(a * b for a, b in pairwise(rest))
        self.freedom = weight * self.freedom + count - 2


def _deviation(values: Sequence[float]) -> float:
    mean = sum(values) / len(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))
