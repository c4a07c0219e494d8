"""Parameters of discrete_move: `discrete_move.yaml`, a user's file, and the ROS parameter server over both."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vsnbench.control.settings import MotionSettings
from vsnbench.errors import RobotError
from vsnbench.settings.validation import first_error
from vsnbench.settings.yaml_file import read_settings
from vsnbench.values.robot_profile import RobotProfile

DEFAULTS = Path(__file__).with_name("discrete_move.yaml")


class DiscreteMoveParameters(BaseModel):
    """Parameters that a user can set; defaults come from the robot's profile."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    linear_velocity_m_s: float | None = Field(default=None, gt=0, le=3)
    angular_velocity_rad_s: float | None = Field(default=None, gt=0, le=10)
    forward_distance_m: float | None = Field(default=None, gt=0, le=10)
    acceleration_share: float | None = Field(default=None, gt=0, le=0.5)
    deceleration_share: float | None = Field(default=None, gt=0, le=0.5)
    position_tolerance_m: float | None = Field(default=None, gt=0, le=0.1)
    turn_tolerance_deg: float | None = Field(default=None, gt=0, le=10)
    max_corrections: int | None = Field(default=None, ge=0, le=100)
    timeout_s: float | None = Field(default=None, gt=0, le=600)
    stall_s: float | None = Field(default=None, gt=0, le=60)
    odometry_timeout_s: float | None = Field(default=None, gt=0, le=60)
    control_rate_hz: float | None = Field(default=None, ge=2, le=1000)
    latency_s: float | None = Field(default=None, ge=0, le=1)

    def over(self, settings: MotionSettings, profile: RobotProfile) -> MotionSettings:
        """Return `settings` with these values, within the limits of the base.

        Raises:
            RobotError: the resulting settings are not valid.
        """
        changes: dict[str, float] = {
            _FIELD_OF.get(name, name): _TO_SETTINGS.get(name, float)(value)
            for name, value in self.model_dump(exclude_none=True).items()
        }
        if "linear_m_s" in changes:
            changes["linear_m_s"] = min(changes["linear_m_s"], profile.base.max_linear_m_s)
        if "angular_rad_s" in changes:
            changes["angular_rad_s"] = min(changes["angular_rad_s"], profile.base.max_angular_rad_s)
        try:
            return MotionSettings.model_validate(settings.model_dump() | changes)
        except ValidationError as error:
            name, problem = first_error(error, MotionSettings)
            raise RobotError(f"discrete_move: {name}: {problem.statement}", advice=problem.advice) from error


_FIELD_OF = {
    "linear_velocity_m_s": "linear_m_s",
    "angular_velocity_rad_s": "angular_rad_s",
    "forward_distance_m": "forward_m",
    "turn_tolerance_deg": "heading_tolerance_rad",
    "control_rate_hz": "control_period_s",
}
_TO_SETTINGS: dict[str, Callable[[Any], float]] = {
    "turn_tolerance_deg": math.radians,
    "control_rate_hz": lambda rate_hz: 1 / rate_hz,
    "max_corrections": int,
}


def motion_settings(
    profile: RobotProfile, file: Path | None = None, ros_parameters: Mapping[str, Any] | None = None
) -> MotionSettings:
    """Return the settings from the profile, then `file` (default DEFAULTS), then the ROS parameters.

    Raises:
        RobotError: a file cannot be read, or a parameter is unknown or out of range.
    """
    settings = MotionSettings.for_robot(profile)
    from_file = read_settings(file or DEFAULTS, DiscreteMoveParameters, RobotError, "discrete_move settings")
    settings = from_file.over(settings, profile)
    if ros_parameters:
        try:
            set_in_ros = DiscreteMoveParameters.model_validate(dict(ros_parameters))
        except ValidationError as error:
            name, problem = first_error(error, DiscreteMoveParameters)
            where = f"ROS parameter ~{name} of discrete_move"
            raise RobotError(f"{where}: {problem.statement}", advice=problem.advice) from error
        settings = set_in_ros.over(settings, profile)
    return settings
