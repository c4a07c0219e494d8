"""The service type that `rosservice call /discrete_move` looks for by name."""

from vsnbench.ros1.messages import DiscreteServer, DiscreteServerRequest, DiscreteServerResponse

__all__ = ["DiscreteServer", "DiscreteServerRequest", "DiscreteServerResponse"]
