"""Simulated robot that a person places at its starts, like a real robot."""

from pathlib import Path

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.contract import Watch
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.sites.site import Site
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.movement import Action, Drive
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.robot_identity import RobotIdentity, kind_of_class


class ByHand(SimulatedRobot):
    """Declares itself a real robot that only a person can place."""

    needs_operator = True
    sensors = SimulatedRobot.sensors - {Sensor.DEPTH}
    """No depth camera, so no placement check runs."""

    def __init__(self, site: Site, parameters: ProtocolParameters) -> None:
        profile = load_profile("turtlebot2")
        small = profile.camera.model_copy(update={"width": 64, "height": 48})
        super().__init__(site, profile.model_copy(update={"camera": small}), parameters)

    @property
    def identity(self) -> RobotIdentity:
        return RobotIdentity(self.profile, kind_of_class(type(self)), simulated=False)

    def locate(self) -> Fix:
        return Fix(super().locate().pose, PoseSource.ESTIMATED)


class Slow(ByHand):
    """Turns slowly, so that a person can press a key."""

    def drive(self, movement: Drive, watch: Watch | None = None) -> MotionResult:
        import time

        time.sleep(0.4)
        return super().drive(movement, watch)


class TurnTwice(Policy):
    """Turns twice and then stops."""

    card = ModelCard("turn-twice")

    def reset(self, goal: str, seed: int) -> None:
        self.left = 2

    def act(self, observation: Observation) -> Decision:
        self.left -= 1
        return Decision(Action.TURN_LEFT if self.left >= 0 else Action.STOP)


class Stuck(Policy):
    """Never returns from reset, and ignores interrupts."""

    card = ModelCard("stuck")

    def reset(self, goal: str, seed: int) -> None:
        Path("in-reset").touch()
        while True:
            try:
                while True:
                    pass
            except BaseException:  # suppress every exception
                continue

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)


class Straying(Policy):
    """Leaves a non-daemon thread running."""

    card = ModelCard("straying")

    def reset(self, goal: str, seed: int) -> None:
        import threading

        threading.Thread(target=threading.Event().wait, name="straying", daemon=False).start()

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)
