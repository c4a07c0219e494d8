"""The formulas of discrete_move (paper, Section 3.1.3): the two errors and the speed profile."""

import math

from vsnbench.motion.settings import MotionSettings
from vsnbench.protocol.actions import Action
from vsnbench.protocol.pose import Pose, wrap_angle


def direction(action: Action) -> int:
    """Return the sign of an action's motion: +1 forward and left, -1 backward and right, 0 for STOP."""
    if action is Action.STOP:
        return 0
    return 1 if action in (Action.MOVE_FORWARD, Action.TURN_LEFT) else -1


def heading_after(action: Action, heading_rad: float, settings: MotionSettings) -> float:
    """Return the absolute heading target after an action that starts with the target `heading_rad`.

    Turns add up exactly because targets follow targets, never measurements: relative turns would let the error of
    each one accumulate.
    """
    return heading_rad + direction(action) * settings.turn_rad if action.turns else heading_rad


def turn_error_rad(target_rad: float, current_rad: float) -> float:
    """Return what is left to turn, counter-clockwise, by the shorter way (paper, Eq. 1)."""
    return wrap_angle(target_rad - current_rad)


def straight_error_m(distance_m: float, start: Pose, current: Pose) -> float:
    """Return what is left to drive; negative past the goal (paper, Eq. 2)."""
    return distance_m - start.distance_to(current)


def speed(initial: float, acceleration: float, way: float) -> float:
    """Return the speed after `way` at constant acceleration: v = sqrt(v_init^2 + 2 a e)."""
    return math.sqrt(max(initial * initial + 2 * acceleration * way, 0.0))


def acceleration(action: Action, settings: MotionSettings) -> float:
    """Return the acceleration that reaches cruising speed within its share of the way; per second squared."""
    return settings.cruise(action) ** 2 / (2 * settings.acceleration_share * settings.way(action))


def deceleration(action: Action, settings: MotionSettings) -> float:
    """Return the braking that stops from cruising speed within its share of the way; per second squared."""
    return settings.cruise(action) ** 2 / (2 * settings.deceleration_share * settings.way(action))


def braking_speed(remaining: float, deceleration: float, period_s: float) -> float:
    """Return the speed to hold for one period so that afterwards v = sqrt(2 a e) still stops in time.

    The paper's formula holds at an instant, but a command acts for a whole period: solving v^2 = 2 a (e - v dt)
    takes that into account, and runs out into e / dt, which ends on the goal instead of beyond it.
    """
    step = deceleration * period_s
    return max(speed(step, deceleration, max(remaining, 0.0)) - step, 0.0)


def ideal_duration_s(action: Action, settings: MotionSettings) -> float:
    """Return how long the profile takes on a base that follows it perfectly."""
    if action is Action.STOP:
        return 0.0
    cruise = settings.cruise(action)
    ramps = cruise / acceleration(action, settings) + cruise / deceleration(action, settings)
    coasting_share = 1 - settings.acceleration_share - settings.deceleration_share
    return ramps + coasting_share * settings.way(action) / cruise
