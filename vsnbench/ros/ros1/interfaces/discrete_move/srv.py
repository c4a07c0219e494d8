"""Service type that `rosservice call /discrete_move` imports by name."""

from vsnbench.ros.ros1.messages import DiscreteServer, DiscreteServerRequest, DiscreteServerResponse

__all__ = ["DiscreteServer", "DiscreteServerRequest", "DiscreteServerResponse"]
