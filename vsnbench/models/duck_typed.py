"""Models that do not inherit from `Policy`, as version 0.1 allowed; deprecated until version 2."""

import inspect
import warnings
from typing import Any

from vsnbench.models.contract import Policy
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.values.decision import Decision
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base


class DuckTypedPolicy(Policy):
    """Adapter for an object with `card`, `reset` and `act`, and optionally `survey` and `close`."""

    def __init__(self, model: Any) -> None:
        _warn(type(model))
        self.model = model
        self.card = model.card
        self.needs_survey = callable(getattr(model, "survey", None))

    @staticmethod
    def fits(model: object) -> bool:
        """Return whether the object has the attributes of a policy."""
        return hasattr(model, "card") and all(callable(getattr(model, name, None)) for name in ("reset", "act"))

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        self.model.reset(goal, seed)

    def act(self, observation: Observation) -> Decision:
        """Return the next action."""
        decision: Decision = self.model.act(observation)
        return decision

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Pass the site on."""
        self.model.survey(site, start, base, parameters)

    def close(self) -> None:
        """Close the model if it can be closed."""
        if callable(close := getattr(self.model, "close", None)):
            close()


def _warn(kind: type) -> None:
    """Warn at the line of the model's class."""
    try:
        file, line = inspect.getsourcefile(kind) or "", inspect.getsourcelines(kind)[1]
    except (OSError, TypeError):
        file, line = "", 0
    message = f"write `class {kind.__name__}(vsnbench.Policy)`: version 2 refuses a model without this base"
    warnings.warn_explicit(message, DeprecationWarning, file or kind.__module__, line)
