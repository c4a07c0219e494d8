"""The interface of a robot profile for a motion adapter over a socket."""

from typing import ClassVar, Literal

from pydantic import ConfigDict, Field

from vsnbench.errors import RobotError
from vsnbench.values.robot_profile import Interface, RobotProfile


class AdapterInterface(Interface):
    """A program that serves the whole robot over a WebSocket: movements, odometry and images."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: ClassVar[str] = "over a motion adapter"

    kind: Literal["adapter"]
    address: str = Field(
        default="ws://127.0.0.1:8770",
        pattern=r"^wss?://[^\s/]+$",
        max_length=300,
        description="address of the adapter; not part of the profile's hash",
    )


def adapter_interface(profile: RobotProfile) -> AdapterInterface:
    """Return the interface of a profile.

    Raises:
        RobotError: the profile has another interface or none.
    """
    if isinstance(profile.interface, AdapterInterface):
        return profile.interface
    raise RobotError(
        f"robot profile {profile.name} has {profile.interface.kind if profile.interface else 'no'} interface",
        advice="use a profile with an interface of `kind: adapter`",
        code="wrong-interface",
    )
