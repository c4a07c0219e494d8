"""What every policy is: reset for a goal, then one decision an observation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from vsnbench.protocol.decision import Decision
from vsnbench.protocol.observation import Observation, Sensor
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.robot_profile import Base
from vsnbench.protocol.site import Site


@dataclass(frozen=True, slots=True)
class ModelCard:
    """What a policy needs, and what the record keeps of it."""

    name: str
    goals: frozenset[str] | None = None
    """The goal categories it knows; None for any."""
    sensors: frozenset[Sensor] = frozenset()
    """The sensors it needs: a robot must have them all, and the policy is shown these and no others."""
    weights_sha256: str = ""
    weights_label: str = ""
    """What the weights are, in words, for every table that shows the model."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """JSON-serialisable: everything else that results depend on, precision among it. Part of the model's identity."""
    runs_on: Mapping[str, str | int | None] = field(default_factory=dict, compare=False)
    """Where and by what it runs (device, runtime, threads): kept as provenance, no part of the model's identity."""
    code: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: what its server says of its source. Part of the model's identity, as the source
    of one in this process is."""
    files: Mapping[str, str] = field(default_factory=dict)
    """For a model in another process: SHA-256 of the files that it was handed there, by option."""
    stand_in: bool = False
    """Nobody named these weights: they only stand in for the model's own, and must not drive a real robot."""


@runtime_checkable
class Policy(Protocol):
    """A visual-semantic-navigation model."""

    card: ModelCard

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode: forget the last one; every random choice in it follows from `seed`."""
        ...

    def act(self, observation: Observation) -> Decision:
        """Return the next action.

        Args:
            observation: the sensors on the card, in read-only arrays of the policy's own; another is not there, and
                reading it is an error that says so.
        """
        ...


@runtime_checkable
class SurveyedPolicy(Policy, Protocol):
    """A policy that is handed the site: an upper bound, never a competitor; its record says so."""

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Learn the whole site, where in it the episode starts, and what drives there; called before each `reset`."""
        ...
