"""Simulated bases on a counted clock: exact, late, sluggish, weak or stuck."""

import math
import random
from dataclasses import dataclass

from vsnbench.control.command import Command, MotionStatus
from vsnbench.control.controller import MotionController
from vsnbench.control.leg import Leg
from vsnbench.control.response import BaseResponse
from vsnbench.control.settings import MotionSettings
from vsnbench.control.standstill import StandstillNoise
from vsnbench.values.pose import Pose

FORWARD, BACKWARD = Leg(0.25), Leg(-0.25)
LEFT, RIGHT = Leg(math.radians(30), turns=True), Leg(-math.radians(30), turns=True)


@dataclass(frozen=True)
class Sample:
    """Command and true pose of a base at a time."""

    at_s: float
    command: Command
    pose: Pose


@dataclass(frozen=True)
class BaseModel:
    """Response of a base to commands, and properties of its odometry."""

    command_delay_s: float = 0.0
    """Delay of a command, seconds."""
    sluggishness_s: float = 0.0
    """Time constant of the first-order lag of its speed."""
    odometry_delay_s: float = 0.0
    """Delay of a reading, seconds."""
    odometry_period_s: float = 0.02
    stamped: bool = True
    """Whether readings have a time stamp."""
    gain: float = 1.0
    """True speed over commanded speed."""
    swerve_rad_per_m: float = 0.0
    """Heading error caused by driving straight."""
    quantum_rad: float = 0.0
    """Resolution of the reported heading."""
    noise_rad: float = 0.0
    """Standard deviation of the reported heading."""


@dataclass(frozen=True)
class Motion:
    """A motion from start to end."""

    controller: MotionController
    start: Pose
    end: Pose
    samples: tuple[Sample, ...]

    @property
    def displacement_m(self) -> float:
        """True distance that the base moved."""
        return self.start.distance_to(self.end)

    @property
    def turn_rad(self) -> float:
        """True angle that the base turned."""
        return self.end.heading_rad - self.start.heading_rad


def move(
    leg: Leg,
    base: BaseModel,
    settings: MotionSettings,
    start: Pose | None = None,
    target_heading_rad: float | None = None,
    response: BaseResponse | None = None,
    seed: int = 0,
) -> Motion:
    """Drive a base with a controller to the end of a leg, and observe what it does in the time after it."""
    chance = random.Random(seed)
    start = start if start is not None else Pose(0.0, 0.0, 0.0)
    target = leg.end_rad(start.heading_rad) if target_heading_rad is None else target_heading_rad
    noise = StandstillNoise(heading_rad=base.noise_rad)
    controller = MotionController(leg, start, target, settings, noise, response=response)
    tick_s = 0.005
    every = max(round(settings.control_period_s / tick_s), 1)
    truth = [start]
    commands: list[Command] = []
    samples: list[Sample] = []
    linear = angular = 0.0
    command = Command()
    ticks_left = 200
    while ticks_left > 0:
        tick = len(truth) - 1
        now_s = tick * tick_s
        if tick % every == 0:
            taken = max(int((now_s - base.odometry_delay_s) / base.odometry_period_s + 1e-9), 0)
            seen = truth[round(taken * base.odometry_period_s / tick_s)]
            if base.quantum_rad:
                rounded = round(seen.heading_rad / base.quantum_rad) * base.quantum_rad
                seen = Pose(seen.x_m, seen.y_m, rounded)
            if base.noise_rad:
                seen = Pose(seen.x_m, seen.y_m, seen.heading_rad + chance.gauss(0.0, base.noise_rad))
            command = controller.step(seen, now_s, taken * base.odometry_period_s if base.stamped else None)
            samples.append(Sample(now_s, command, truth[-1]))
        commands.append(command)
        acting = commands[tick - round(base.command_delay_s / tick_s)] if now_s >= base.command_delay_s else Command()
        follow = 1.0 if base.sluggishness_s == 0 else 1 - math.exp(-tick_s / base.sluggishness_s)
        linear += follow * (acting.linear_m_s * base.gain - linear)
        angular += follow * (acting.angular_rad_s * base.gain - angular)
        here = truth[-1]
        step_rad = angular * tick_s + base.swerve_rad_per_m * linear * tick_s
        middle = here.heading_rad + step_rad / 2
        truth.append(
            Pose(
                here.x_m + linear * tick_s * math.cos(middle),
                here.y_m + linear * tick_s * math.sin(middle),
                here.heading_rad + step_rad,
            )
        )
        if controller.status is not MotionStatus.MOVING:
            ticks_left -= 1
    return Motion(controller, start, truth[-1], tuple(samples))
