"""A robot that a person puts at its starts, like a real one; it drives in the embedded apartment."""

from pathlib import Path

from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.robots.simulated import SimulatedRobot
from vsnbench.sites.site import Site
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.fix import Fix, PoseSource
from vsnbench.values.motion_result import MotionResult
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.robot_identity import RobotIdentity, kind_of_class


class ByHand(SimulatedRobot):
    """Says that it is real, and that nothing but a person can place it."""

    needs_operator = True
    sensors = SimulatedRobot.sensors - {Sensor.DEPTH}
    """It says nothing of its depth camera: nobody checks how it stands."""

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
    """Takes its time over every turn, so that a person can press a key."""

    def execute(self, action: Action) -> MotionResult:
        import time

        time.sleep(0.4)
        return super().execute(action)


class TurnTwice(Policy):
    """Turns twice, and stops."""

    card = ModelCard("turn-twice")

    def reset(self, goal: str, seed: int) -> None:
        self.left = 2

    def act(self, observation: Observation) -> Decision:
        self.left -= 1
        return Decision(Action.TURN_LEFT if self.left >= 0 else Action.STOP)


class Stuck(Policy):
    """Never comes back from reset, whatever it is told."""

    card = ModelCard("stuck")

    def reset(self, goal: str, seed: int) -> None:
        Path("in-reset").touch()
        while True:
            try:
                while True:
                    pass
            except BaseException:  # as deaf as code can be
                continue

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)


class Straying(Policy):
    """Leaves a thread running that is no daemon."""

    card = ModelCard("straying")

    def reset(self, goal: str, seed: int) -> None:
        import threading

        threading.Thread(target=threading.Event().wait, name="straying", daemon=False).start()

    def act(self, observation: Observation) -> Decision:
        return Decision(Action.STOP)
