"""The oracle by waypoints: the plan of the oracle, with each turn and the way straight on after it as one waypoint."""

import math
from dataclasses import replace

from vsnbench.models.baselines.oracle import Oracle
from vsnbench.models.baselines.route import Route
from vsnbench.models.baselines.standstill import Standstill
from vsnbench.protocol.free_space import FreeSpace
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.movement import MAX_DISTANCE_M, Action, ActionKind, Waypoint
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose, wrap_angle

_OFF_ROUTE_M = 0.25
"""A robot that drives on and is farther than this from its route needs another one."""
_ARRIVED_M, _FACES_RAD = 0.08, math.radians(6)


class WaypointOracle(Oracle):
    """Upper bound for models that answer with waypoints.

    Where the robot drives on while it thinks, it keeps its first plan as a route, and answers with the corner that
    follows the place where the robot will be when the answer takes effect.
    """

    card = replace(
        Oracle.card, name="oracle-waypoints", action_kinds=frozenset({ActionKind.DISCRETE, ActionKind.WAYPOINT})
    )
    _route: Route | None = None
    _last: tuple[float, Pose] | None = None
    """Time and pose of the observation before."""
    _still = Standstill(None)

    def act(self, observation: Observation) -> Decision:
        """Return the next waypoint of the plan; see `Oracle.act`."""
        if self._parameters.execution is not None and self._space is not None:
            return self._act_driving(self._space, observation)
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

    def _forget(self) -> None:
        super()._forget()
        self._route = self._last = None
        self._still = Standstill(self._parameters.execution)

    def _act_driving(self, space: FreeSpace, observation: Observation) -> Decision:
        """Return the waypoint for a robot that drives on until the answer takes effect."""
        here, now_s = self._start.compose(observation.pose), observation.stamp_s
        ahead_m = 0.0 if self._last is None else here.distance_to(self._last[1])
        self._last = now_s, here
        if self._still.is_stuck(here, now_s) and self._route is not None:
            self._refused.append(here)
            self._route = None
        if self._route is None or self._route.advance(here) > _OFF_ROUTE_M:
            self._still.forget()
            self._make_plan(space, here, observation.camera.mount_height_m)
            if self._planner is None:
                return Decision(Action.STOP, diagnostics=Diagnostics(note=self._note))
            self._route = Route(self._planner.follow(here, self._actions))
        route = self._route
        shown = tuple(pose.relative_to(self._start).position for pose in route.poses)
        diagnostics = Diagnostics(sub_goal=shown[-1], path=shown, scalars={"route_left_m": route.left_m})
        turn_rad = abs(wrap_angle(route.end.heading_rad - here.heading_rad))
        if route.left_m < _ARRIVED_M and turn_rad < _FACES_RAD:
            return Decision(Action.STOP, diagnostics=diagnostics)
        corner, is_end = route.corner_after(ahead_m)
        target = corner.relative_to(here)
        if (distance_m := math.hypot(*target.position)) > MAX_DISTANCE_M:
            share = 0.99 * MAX_DISTANCE_M / distance_m
            return Decision(Waypoint(share * target.x_m, share * target.y_m), diagnostics=diagnostics)
        heading_rad = wrap_angle(target.heading_rad) if is_end else None
        return Decision(Waypoint(target.x_m, target.y_m, heading_rad), diagnostics=diagnostics)


def _straight_on(plan: tuple[Action, ...]) -> tuple[Action, ...]:
    """Return the turns at the beginning of a plan, and the forward moves after them that one waypoint can cover."""
    moves = 0
    for count, action in enumerate(plan):
        if (action.turns and moves) or action is Action.STOP or moves * 0.5 > MAX_DISTANCE_M:
            return plan[:count]
        moves += action is Action.MOVE_FORWARD
    return plan
