"""A model that always drives on ahead, for runs over ROS."""

from vsnbench import ActionKind, Decision, ModelCard, Observation, Policy, Sensor, Waypoint


class Onward(Policy):
    """Answers with a point 1 m ahead."""

    card = ModelCard("onward", sensors=frozenset({Sensor.ODOMETRY}), action_kinds=frozenset({ActionKind.WAYPOINT}))

    def reset(self, goal: str, seed: int) -> None:
        pass

    def act(self, observation: Observation) -> Decision:
        return Decision(Waypoint(1.0, 0.0))
