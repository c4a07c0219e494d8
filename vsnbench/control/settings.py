"""Settings of discrete motions: distances, speeds, tolerances and limits."""

import math
from dataclasses import replace
from typing import Self

from pydantic import BaseModel, ConfigDict, Field

from vsnbench.control.command import Command
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.movement import Velocity
from vsnbench.values.robot_profile import RobotProfile


class MotionSettings(BaseModel):
    """Settings of the control law; defaults from the paper (Section 3.1.3 and its table of parameters)."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    forward_m: float = Field(default=0.25, gt=0, le=10, description="length of a forward or backward move")
    turn_rad: float = Field(default=math.radians(30), gt=0, le=math.tau, description="angle of a turn")
    linear_m_s: float = Field(default=0.3, gt=0, le=3, description="cruising speed of a move")
    angular_rad_s: float = Field(default=0.5, gt=0, le=10, description="cruising speed of a turn")
    lateral_m_s: float = Field(default=0.0, ge=0, le=3, description="cruising speed sideways; 0 if the base cannot")
    slowest_m_s: float = Field(default=0.0, ge=0, le=3, description="slower commands ahead are never sent, but 0")
    slowest_rad_s: float = Field(default=0.0, ge=0, le=10, description="slower turns are never commanded, but 0")
    slowest_lateral_m_s: float = Field(
        default=0.0, ge=0, le=3, description="slower ones sideways are never sent, but 0"
    )
    acceleration_share: float = Field(default=1 / 3, gt=0, le=0.5, description="share of the way spent accelerating")
    deceleration_share: float = Field(default=1 / 3, gt=0, le=0.5, description="share of the way spent braking")
    position_tolerance_m: float = Field(default=0.005, gt=0, le=0.1, description="a move is good under this error")
    heading_tolerance_rad: float = Field(
        default=math.radians(0.1), gt=0, le=0.2, description="a turn is good under this error"
    )
    aim_share: float = Field(default=0.5, gt=0, le=1, description="share of the tolerance that corrections aim for")
    max_corrections: int = Field(default=5, ge=0, le=100, description="corrections of one motion before giving up")
    timeout_s: float = Field(default=10.0, gt=0, le=600, description="time allowed beyond the ideal profile's")
    stall_s: float = Field(default=1.0, gt=0, le=60, description="a base that does not follow for this long is stuck")
    odometry_timeout_s: float = Field(default=1.0, gt=0, le=60, description="older odometry is lost odometry")
    control_period_s: float = Field(default=0.02, gt=0, le=0.5, description="time between two commands")
    latency_s: float = Field(default=0.0, ge=0, le=1, description="dead time of odometry, until it is measured")
    settle_s: float = Field(default=0.06, gt=0, le=5, description="the pose must not change for this long")
    heading_gain_per_s: float = Field(default=3.0, ge=0, le=20, description="how hard a move holds its heading")
    ramps_are_limits: bool = Field(
        default=False, description="whether the base follows no steeper ramps than an action has"
    )

    @classmethod
    def for_robot(cls, profile: RobotProfile, parameters: ProtocolParameters | None = None) -> Self:
        """Return the settings for a robot and the protocol's actions, within the limits of the base.

        The speed of an action is so low that its ramps, each a share of its way, keep the limits of the acceleration.
        """
        protocol = parameters if parameters is not None else ProtocolParameters()
        base, forward_m, turn_rad = profile.base, protocol.forward_m, math.radians(protocol.turn_deg)
        share = 2 * profile.speeds.acceleration_share
        fastest_m_s = min(profile.speeds.linear_m_s, _ramped(base.max_acceleration_m_s2, share * forward_m))
        fastest_rad_s = min(profile.speeds.angular_rad_s, _ramped(base.max_acceleration_rad_s2, share * turn_rad))
        return cls(
            forward_m=forward_m,
            turn_rad=turn_rad,
            linear_m_s=max(min(fastest_m_s, base.max_linear_m_s), base.min_linear_m_s),
            angular_rad_s=max(min(fastest_rad_s, base.max_angular_rad_s), base.min_angular_rad_s),
            lateral_m_s=max(min(fastest_m_s, base.max_lateral_m_s), base.min_lateral_m_s),
            slowest_m_s=base.min_linear_m_s,
            slowest_rad_s=base.min_angular_rad_s,
            slowest_lateral_m_s=base.min_lateral_m_s,
            latency_s=base.dead_time_s or 0.0,
            acceleration_share=profile.speeds.acceleration_share,
            deceleration_share=profile.speeds.acceleration_share,
            ramps_are_limits=bool(base.max_acceleration_m_s2 or base.max_acceleration_rad_s2),
            **_tolerances(profile),
            # More than two new readings: slow odometry repeats its value while the robot still rolls.
            settle_s=max(0.06, 2.5 / profile.base.odometry_rate_hz),
        )

    def sendable(self, command: Command) -> Command:
        """Return a command whose velocities are zero or fast enough for the base."""
        if not (self.slowest_m_s or self.slowest_rad_s or self.slowest_lateral_m_s):
            return command
        return Command(
            _fast_enough(command.linear_m_s, self.slowest_m_s),
            _fast_enough(command.angular_rad_s, self.slowest_rad_s),
            _fast_enough(command.lateral_m_s, self.slowest_lateral_m_s),
        )

    def executable(self, velocity: Velocity) -> Velocity:
        """Return a velocity without the axes on which it is slower than the base can move: it would take them as 0."""
        return replace(
            velocity,
            linear_m_s=velocity.linear_m_s if abs(velocity.linear_m_s) >= self.slowest_m_s else 0.0,
            angular_rad_s=velocity.angular_rad_s if abs(velocity.angular_rad_s) >= self.slowest_rad_s else 0.0,
            lateral_m_s=velocity.lateral_m_s if abs(velocity.lateral_m_s) >= self.slowest_lateral_m_s else 0.0,
        )

    def cruise(self, *, turns: bool) -> float:
        """Return the cruising speed: rad/s of a turn, m/s of a move."""
        return self.angular_rad_s if turns else self.linear_m_s

    def tolerance(self, *, turns: bool) -> float:
        """Return the tolerance: radians of a turn, metres of a move."""
        return self.heading_tolerance_rad if turns else self.position_tolerance_m


def _ramped(acceleration: float | None, twice_way: float) -> float:
    """Return the speed that an acceleration reaches within a way; infinity without a limit."""
    return math.inf if acceleration is None else math.sqrt(acceleration * twice_way)


def _fast_enough(velocity: float, slowest: float) -> float:
    return math.copysign(max(abs(velocity), slowest), velocity) if velocity else 0.0


def _tolerances(profile: RobotProfile) -> dict[str, float]:
    if profile.tolerances is None:
        return {}
    return {
        "position_tolerance_m": profile.tolerances.position_m,
        "heading_tolerance_rad": math.radians(profile.tolerances.turn_deg),
    }
