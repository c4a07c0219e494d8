"""Formulas of discrete_move (paper, Section 3.1.3): the two errors and the speed profile."""

import math

from vsnbench.control.settings import MotionSettings
from vsnbench.values.action import Action
from vsnbench.values.pose import Pose, wrap_angle


def direction(action: Action) -> int:
    """Return the sign of an action's motion: +1 forward and left, -1 backward and right, 0 for STOP and NOOP."""
    if not action.moves:
        return 0
    return 1 if action in (Action.MOVE_FORWARD, Action.TURN_LEFT) else -1


def heading_after(action: Action, heading_rad: float, settings: MotionSettings) -> float:
    """Return the absolute heading target after an action that starts with the target `heading_rad`.

    Targets follow targets, not measurements, so that errors of turns do not accumulate.
    """
    return heading_rad + direction(action) * settings.turn_rad if action.turns else heading_rad


def turn_error_rad(target_rad: float, current_rad: float) -> float:
    """Return the remaining turn, counter-clockwise, in the shorter direction (paper, Eq. 1)."""
    return wrap_angle(target_rad - current_rad)


def straight_error_m(distance_m: float, start: Pose, current: Pose) -> float:
    """Return the remaining distance; negative beyond the goal (paper, Eq. 2)."""
    return distance_m - start.distance_to(current)


def speed(initial: float, acceleration: float, way: float) -> float:
    """Return the speed after `way` at constant acceleration: v = sqrt(v_init^2 + 2 a e)."""
    return math.sqrt(max(initial * initial + 2 * acceleration * way, 0.0))


def acceleration(action: Action, settings: MotionSettings) -> float:
    """Return the acceleration that reaches cruising speed within its share of the distance, per second squared."""
    return settings.cruise(action) ** 2 / (2 * settings.acceleration_share * settings.way(action))


def deceleration(action: Action, settings: MotionSettings) -> float:
    """Return the deceleration that stops from cruising speed within its share of the distance, per second squared."""
    return settings.cruise(action) ** 2 / (2 * settings.deceleration_share * settings.way(action))


def braking_speed(remaining: float, deceleration: float, period_s: float) -> float:
    """Return the speed for one period after which v = sqrt(2 a e) still stops in time.

    The paper's formula is for an instant, but a command acts for a whole period. The solution of v^2 = 2 a (e - v dt)
    includes this and approaches e / dt, which ends at the goal instead of beyond it.
    """
    step = deceleration * period_s
    return max(speed(step, deceleration, max(remaining, 0.0)) - step, 0.0)


def ideal_duration_s(action: Action, settings: MotionSettings) -> float:
    """Return the duration of the profile on a base that follows it perfectly, seconds."""
    if not action.moves:
        return 0.0
    cruise = settings.cruise(action)
    ramps = cruise / acceleration(action, settings) + cruise / deceleration(action, settings)
    coasting_share = 1 - settings.acceleration_share - settings.deceleration_share
    return ramps + coasting_share * settings.way(action) / cruise
