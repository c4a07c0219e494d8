"""A part of a movement from rest to rest."""

import math
from dataclasses import dataclass

from vsnbench.control.settings import MotionSettings
from vsnbench.values.movement import Velocity


@dataclass(frozen=True, slots=True)
class Leg:
    """One motion from rest to rest: a turn, a straight or curved way, a way to the side, or a velocity."""

    way: float = 0.0
    """Radians of a turn, positive to the left; metres of a straight leg, positive forwards or, of a lateral one, to the
    left; length of a curved one."""
    heading_rad: float | None = None
    """Absolute heading at the end of a turn or a straight leg, in the frame of the odometry; None to turn from the held
    heading, or to keep it."""
    turns: bool = False
    path: tuple[tuple[float, float], ...] = ()
    """Points of a curved leg in the frame of the odometry, from the robot's position on."""
    velocity: Velocity | None = None
    target: tuple[float, float] | None = None
    """End of a straight leg in the frame of the odometry; None for a distance alone."""
    is_lateral: bool = False
    """Whether a straight leg goes to the side, to its target, while the robot keeps its heading."""
    tolerance_rad: float = 0.0
    """Tolerance of a turn whose heading the next leg corrects or that is not exact; 0 for that of the robot."""

    @property
    def translates(self) -> bool:
        """Whether the robot leaves its position."""
        if self.velocity is not None:
            return self.velocity.speed_m_s != 0.0
        return not self.turns

    @property
    def holds_heading(self) -> bool:
        """Whether the held heading decides about the end."""
        return self.heading_rad is None and not self.path and self.velocity is None

    @property
    def backs_off(self) -> bool:
        """Whether the robot drives straight backwards."""
        return self.way < 0 and not self.turns and not self.is_lateral

    def end_rad(self, held_rad: float) -> float:
        """Return the absolute heading at the end of a turn or a straight leg.

        Args:
            held_rad: the held heading; targets follow targets, not measurements, so that errors of turns do not add up.
        """
        if self.heading_rad is not None:
            return self.heading_rad
        return held_rad + self.way if self.turns else held_rad

    def settings(self, settings: MotionSettings) -> MotionSettings:
        """Return the settings of this leg.

        An action of the paper uses its shares of any way. Other legs have the acceleration of such an action, and are
        slower if they are shorter. A lateral leg is a straight one with the speed sideways.
        """
        amount = abs(self.way)
        if self.is_lateral:
            slowest = settings.slowest_lateral_m_s
            settings = settings.model_copy(update={"linear_m_s": settings.lateral_m_s, "slowest_m_s": slowest})
        if self.velocity is not None or amount <= 0:
            return settings
        way, speed = ("turn_rad", "angular_rad_s") if self.turns else ("forward_m", "linear_m_s")
        least = settings.slowest_rad_s if self.turns else settings.slowest_m_s
        standard = getattr(settings, way)
        if self.holds_heading:
            return settings if amount == standard else settings.model_copy(update={way: amount})
        share = min(1.0, standard / amount)
        slower = math.sqrt(min(1.0, amount / standard))
        return settings.model_copy(
            update={
                way: amount,
                speed: max(getattr(settings, speed) * slower, least),
                "acceleration_share": settings.acceleration_share * share,
                "deceleration_share": settings.deceleration_share * share,
                "heading_tolerance_rad": max(settings.heading_tolerance_rad, self.tolerance_rad),
            }
        )
