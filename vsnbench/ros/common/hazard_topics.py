"""Topics of the hazard sensors of a base, and their faults on the network."""

from collections.abc import Collection
from dataclasses import dataclass

from vsnbench.errors import RobotError

WRONG_TYPE = "wrong-topic-type"
"""Code of a fault with which no session may begin; other faults leave the reports to the operator."""
_OPERATOR = "until then the operator has to report it (space bar)"


@dataclass(frozen=True, slots=True)
class HazardTopic:
    """A topic on which a base reports contacts, missing floor or lifted wheels."""

    field: str
    """Field of the profile's interface that names the topic."""
    topic: str
    kind: str
    """Type of the messages in the profile, as the middleware names it."""
    start: str = "start its driver"
    """How to have the topic published."""
    missing_package: str = ""
    """Package of the type, if it is not installed on this machine."""

    def fault(self, types: Collection[str]) -> RobotError | None:
        """Return why no report can arrive on the topic, or None.

        Args:
            types: types of the publishers of the topic; empty if no node publishes it.
        """
        if not types:
            return RobotError(
                f"no node publishes {self.topic}, which the profile has as interface.{self.field}",
                advice=f"{self.start}, or correct the profile; {_OPERATOR}",
                code="unpublished-hazard-topic",
            )
        if self.kind not in types:
            return RobotError(
                f"{self.topic} is a {' and '.join(sorted(types))}, not a {self.kind}",
                advice=f"correct interface.{self.field} in the profile, or the type that it has for this topic",
                code=WRONG_TYPE,
            )
        if self.missing_package:
            return RobotError(
                f"{self.topic} cannot be read: {self.missing_package} is not installed",
                advice=f"install it with the ROS distribution of the robot; {_OPERATOR}",
                code="no-hazard-type",
            )
        return None
