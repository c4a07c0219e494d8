"""Formulas of discrete_move (paper, Section 3.1.3): the two errors and the speed profile."""

import math

from vsnbench.control.settings import MotionSettings
from vsnbench.values.pose import Pose, wrap_angle


def turn_error_rad(target_rad: float, current_rad: float) -> float:
    """Return the remaining turn, counter-clockwise, in the shorter direction (paper, Eq. 1)."""
    return wrap_angle(target_rad - current_rad)


def straight_error_m(distance_m: float, start: Pose, current: Pose) -> float:
    """Return the remaining distance; negative beyond the goal (paper, Eq. 2)."""
    return distance_m - start.distance_to(current)


def speed(initial: float, acceleration: float, way: float) -> float:
    """Return the speed after `way` at constant acceleration: v = sqrt(v_init^2 + 2 a e)."""
    return math.sqrt(max(initial * initial + 2 * acceleration * way, 0.0))


def acceleration(cruise: float, way: float, share: float) -> float:
    """Return the acceleration that reaches cruising speed, or stops from it, within a share of the way.

    Args:
        cruise: m/s or rad/s.
        way: length of the motion, metres or radians.
        share: share of the way.
    """
    return cruise**2 / (2 * share * way)


def braking_speed(remaining: float, deceleration: float, period_s: float) -> float:
    """Return the speed for one period after which v = sqrt(2 a e) still stops in time.

    The paper's formula is for an instant, but a command acts for a whole period. The solution of v^2 = 2 a (e - v dt)
    includes this and approaches e / dt, which ends at the goal instead of beyond it.
    """
    step = deceleration * period_s
    return max(speed(step, deceleration, max(remaining, 0.0)) - step, 0.0)


def ideal_duration_s(way: float, settings: MotionSettings, *, turns: bool) -> float:
    """Return the duration of the profile of a way, metres or radians, on a base that follows it perfectly; seconds."""
    if not way:
        return 0.0
    cruise, shares = settings.cruise(turns=turns), (settings.acceleration_share, settings.deceleration_share)
    ramps = cruise / acceleration(cruise, way, shares[0]) + cruise / acceleration(cruise, way, shares[1])
    return ramps + (1 - shares[0] - shares[1]) * way / cruise
