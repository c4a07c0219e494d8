"""The oracle by waypoints: the plan of the oracle, with each turn and the way straight on after it as one waypoint."""

from dataclasses import replace

from vsnbench.models.baselines.oracle import Oracle
from vsnbench.values.action import Action
from vsnbench.values.decision import Decision
from vsnbench.values.movement import MAX_DISTANCE_M, ActionKind, Waypoint
from vsnbench.values.observation import Observation


class WaypointOracle(Oracle):
    """Upper bound for models that answer with waypoints."""

    card = replace(
        Oracle.card, name="oracle-waypoints", action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT})
    )

    def act(self, observation: Observation) -> Decision:
        """Return the next waypoint of the plan; see `Oracle.act`."""
        decision = super().act(observation)
        if decision.action is Action.STOP or self._planner is None:
            return decision
        here = self._start.compose(observation.pose)
        plan = (decision.action, *self._actions)
        straight = _straight_on(plan)
        pose = self._planner.follow(here, straight)[-1].relative_to(here)
        self._actions = plan[len(straight) :]
        moves = Action.MOVE_FORWARD in straight
        self._before_move = here if moves else None
        waypoint = Waypoint(pose.x_m, pose.y_m, None if moves else pose.heading_rad)
        return Decision(waypoint, diagnostics=decision.diagnostics)


def _straight_on(plan: tuple[Action, ...]) -> tuple[Action, ...]:
    """Return the turns at the beginning of a plan, and the forward moves after them that one waypoint can cover."""
    moves = 0
    for count, action in enumerate(plan):
        if (action.turns and moves) or action is Action.STOP or moves * 0.5 > MAX_DISTANCE_M:
            return plan[:count]
        moves += action is Action.MOVE_FORWARD
    return plan
