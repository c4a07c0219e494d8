"""One of our own policies behind the wire, for `vsnbench models serve` and for a model that is isolated."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vsnbench.errors import UsageError
from vsnbench.models.contract import Policy, SurveyedPolicy
from vsnbench.models.identity import code_of, files_handed_over
from vsnbench.models.remote import vsnbench_policy as wire
from vsnbench.protocol.camera import Camera
from vsnbench.protocol.codec import decision_to_message
from vsnbench.protocol.decision_check import checked_decision
from vsnbench.protocol.observation import Observation, Sensor, observation_of, shown_to_policy
from vsnbench.protocol.pose import Pose


class ServedPolicy:
    """A policy as `vsnbench_policy.serve` wants it."""

    def __init__(self, policy: Policy, name: str = "", options: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Take a policy.

        Args:
            policy: who answers.
            name: how it was named, and
            options: what it was handed: both as `create_policy` takes them, for its identity.

        Raises:
            UsageError: it is an upper bound that is handed the site, or needs the simulator's labels: neither is sent.
        """
        card = policy.card
        if isinstance(policy, SurveyedPolicy):
            raise UsageError(
                f"model {card.name} is handed the site, which no wire carries", advice="run it in this process"
            )
        if Sensor.INSTANCES in card.sensors:
            raise UsageError(
                f"model {card.name} needs the simulator's own labels, which no wire carries",
                advice="give it a real detector",
            )
        self._policy = policy
        self._sensors = frozenset(card.sensors)
        self.card = {
            "name": card.name,
            "goals": None if card.goals is None else sorted(card.goals),
            "sensors": sorted(sensor.value for sensor in card.sensors),
            "weights_sha256": card.weights_sha256,
            "weights_label": card.weights_label,
            "settings": dict(card.settings),
            "stand_in": card.stand_in,
            "code": code_of(policy),
            "files": files_handed_over(name, policy, options),
            "runs_on": dict(card.runs_on),
        }

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        self._policy.reset(goal, seed)

    def act(self, given: wire.Observation) -> dict[str, Any]:
        """Return the decision as the wire carries it."""
        decision = checked_decision(self._policy.act(shown_to_policy(_observation(given), self._sensors)))
        return decision_to_message(decision)


def _observation(given: wire.Observation) -> Observation:
    try:
        camera = Camera.model_validate(vars(given.camera))
    except ValueError as error:
        raise wire.WireError(f"`camera`: {' '.join(str(error).split())[:300]}") from error
    measured: dict[str, Any] = {"rgb": given.rgb, "depth_m": given.depth_m}
    if given.pose is not None:
        measured["pose"] = Pose(given.pose.x_m, given.pose.y_m, given.pose.heading_rad)
    there = {name: value for name, value in measured.items() if value is not None}
    return observation_of(given.stamp_s, camera, **there)
