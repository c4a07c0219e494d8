"""Names of models: built-in models and plug-ins."""

from pathlib import Path

from vsnbench.errors import UsageError
from vsnbench.plugins import plug_ins
from vsnbench.values.model.person import HUMAN

ENTRY_POINT_GROUP = "vsnbench.models"

BUILT_IN: dict[str, str] = {
    "random": "vsnbench.models.baselines.random_walk:RandomWalk",
    "forward": "vsnbench.models.baselines.forward:ForwardUntilBlocked",
    "oracle": "vsnbench.models.baselines.oracle:Oracle",
    "oracle-waypoints": "vsnbench.models.baselines.waypoint_oracle:WaypointOracle",
    "pirlnav": "vsnbench.models.pirlnav.policy:PIRLNav",
    "frontier": "vsnbench.models.baselines.frontier:Frontier",
    "frontier-waypoints": "vsnbench.models.baselines.waypoint_frontier:WaypointFrontier",
    "vlv": "vsnbench.models.vlv.policy:VLV",
    HUMAN: "vsnbench.models.human.policy:Human",
}
"""Name -> class."""


def known_models() -> list[str]:
    """Return the names that `create_policy` accepts: built-in models, then plug-ins."""
    return [*BUILT_IN, *sorted(set(plug_ins(ENTRY_POINT_GROUP)) - set(BUILT_IN))]


def class_of(name: str) -> str:
    """Return `package.module:Class` of a built-in model or plug-in; other names as they are."""
    return BUILT_IN.get(name) or plug_ins(ENTRY_POINT_GROUP).get(name) or name


def is_third_party(name: str) -> bool:
    """Return whether a name stands for code outside vsnbench. A server and a stack's file describe their models."""
    return (
        not is_address(name)
        and not is_stack(name)
        and not is_human(name)
        and class_of(name).partition(":")[0].partition(".")[0] != "vsnbench"
    )


def is_address(name: str) -> bool:
    """Return whether a name is the address of a model's server."""
    return name.startswith(("ws://", "wss://"))


STACK_PREFIX = "stack:"


def is_stack(name: str) -> bool:
    """Return whether a name is `stack:` with the file of a stack that drives itself."""
    return name.startswith(STACK_PREFIX)


def stack_file(name: str) -> Path:
    """Return the file of a stack's name."""
    return Path(name.removeprefix(STACK_PREFIX))


def is_human(name: str) -> bool:
    """Return whether a name is `human`, or `human:` with the name of the person who drives."""
    return name.partition(":")[0] == HUMAN


def driver_of(name: str) -> str:
    """Return the driver in the name of a person; empty without one."""
    return name.partition(":")[2].strip()


def require_no_person(name: str, command: str) -> None:
    """Check that a model is not a person, who can only drive the trials of one campaign.

    Raises:
        UsageError: it is.
    """
    if is_human(name):
        raise UsageError(
            f"{command}: {name} is a person, who drives the trials of `vsnbench run`",
            advice=f"vsnbench run --model {name} --goal chair",
            code="needs-driver",
        )
