"""What every robot, simulated or real, can do; the runner knows no more about it than this."""

from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.actions import Action
from vsnbench.protocol.battery import Battery
from vsnbench.protocol.fix import Fix
from vsnbench.protocol.motion_result import MotionResult
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_identity import RobotIdentity
from vsnbench.protocol.site import StartingPosition


@runtime_checkable
class Robot(Protocol):
    """A mobile base with a camera that carries out one discrete action at a time.

    Every method may raise RobotError. `halt` must be safe to call at any time, more than once, and on every way out.
    """

    @property
    def identity(self) -> RobotIdentity:
        """Who the robot is: what it, or the thing at the other end, says of itself; constant while it is open."""
        ...

    @property
    def sensors(self) -> frozenset[Sensor]:
        """What its observations carry."""
        ...

    @property
    def conditions(self) -> Mapping[str, Any]:
        """What else results depend on, as JSON by name; empty for nothing.

        `noise` holds the settings of simulated noise where there is some; others are `simulator` (its version),
        `command_lag_s`, `odometry_rate_hz`, `rate_factor`, `depth_frames`.
        """
        ...

    def begin(self, start: StartingPosition, seed: int) -> None:
        """Stand at `start`, where a person has put a robot that needs one, with odometry zeroed there.

        Raises:
            NotPlacedError: it does not stand as it should; a person can put that right.
            RobotError: it cannot begin.
        """
        ...

    def observe(self) -> Observation:
        """Return fresh measurements, taken after the last motion ended."""
        ...

    def execute(self, action: Action) -> MotionResult:
        """Carry out one action to its end, and say what was measured; STOP stands still."""
        ...

    def locate(self) -> Fix:
        """Return where the robot stands in the site, for the judge; the policy never sees it."""
        ...

    def halt(self) -> None:
        """Command zero velocity."""
        ...

    def close(self) -> None:
        """Halt and let go of everything."""
        ...

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@runtime_checkable
class PlacedByHand(Robot, Protocol):
    """A robot that may need a person to put it at the start of every episode, before `begin`.

    Its `begin` raises NotPlacedError where it does not stand as it should and a person can put that right.
    """

    needs_a_person: bool


@runtime_checkable
class StartsWhereMeasured(PlacedByHand, Protocol):
    """A robot whose estimated trajectory can begin where it was measured to stand, rather than at its mark."""

    def stands_at(self, pose: Pose) -> None:
        """Take that it stands there, in the site's frame; said after `begin` and before the first action."""
        ...


@runtime_checkable
class CarriedInPlay(PlacedByHand, Protocol):
    """A robot that plays a real one, the person who places it included: nobody can carry it, so `carry` does."""

    is_carried_in_play: bool

    def carry(self, start: StartingPosition, seed: int) -> None:
        """Put it down near the mark, as a person does who was asked to; nearer, where it stands there already.

        Raises:
            RobotError: it cannot stand there.
        """
        ...


ReadBattery = Callable[[], Battery | None]
"""Returns what a base said of its battery last, from any thread; None while it has said nothing."""


@runtime_checkable
class BatteryPowered(Robot, Protocol):
    """A robot whose base may say how full its battery is."""

    @property
    def battery(self) -> ReadBattery:
        """Returns what it said last; None where it has said nothing, or never does."""
        ...


def battery_of(robot: Robot) -> ReadBattery:
    """Return how to ask a robot for its battery; one that says nothing of it always answers None."""
    return robot.battery if isinstance(robot, BatteryPowered) else lambda: None


Glimpse = Callable[[], npt.NDArray[np.uint8] | None]
"""Returns what a camera saw last, (H, W, 3), in the midst of a motion too and from any thread; None for nothing new."""


@runtime_checkable
class SeenDriving(Robot, Protocol):
    """A robot whose camera can be looked through while it drives."""

    @property
    def glimpse(self) -> Glimpse:
        """What its camera sees now; no observation: nothing waits for it, and it belongs to no action."""
        ...


@runtime_checkable
class MadeReady(Robot, Protocol):
    """A robot whose parts may have to be waited for, before a person is asked to carry it anywhere."""

    def make_ready(self) -> None:
        """Return when every part answers.

        Raises:
            RobotError: one does not; the message says what to start.
        """
        ...
