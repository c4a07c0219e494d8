"""The model `oracle`: the shortest path on the site's map to a view of the nearest goal instance, then STOP.

The only built-in model that receives the site: an upper bound, and a check that every trial of a site is solvable.
"""

import itertools
import math
from dataclasses import replace
from typing import Final

from vsnbench.errors import ModelError
from vsnbench.models.baselines.goal_views import ViewCriteria, ViewPoints, target_poses, view_points
from vsnbench.models.baselines.lattice_planner import LatticePlanner, NeededSpace
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.protocol.free_space import BoolGrid, FreeSpace, free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.sites.targets import definition_sha256
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.goal import Goal, GoalKind
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation, Sensor
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

_NO_MOTION_SHARE = 0.5
"""A forward move with odometry of less than this share of its length was refused or blocked."""
_DRIFT_M = 0.01
"""A plan stays valid while the robot's position errors use up no more than this of its clearance."""
_STALE_HEADING_RAD = math.radians(3.0)
"""A heading farther than this from the planner's headings needs a new planner."""


STOP_WITHIN_M: Final = 0.80
"""Distance to the goal's footprint at which it stops; less than the protocol's success distance."""
HALF_VIEW_DEG: Final = 25.0
"""Largest angle between its heading and the goal there."""


class Oracle(Policy):
    """Plans over positions and headings, and plans again when odometry contradicts the plan."""

    needs_survey = True
    card = ModelCard("oracle", goal_kinds=frozenset(GoalKind), sensors=frozenset({Sensor.ODOMETRY}))

    def __init__(self, stop_within_m: float = STOP_WITHIN_M) -> None:
        """Set the distance to the goal's footprint at which to stop, in metres."""
        self._stop_within_m = stop_within_m
        self.card = replace(
            self.card, settings={"stop_within_m": stop_within_m, "half_view_deg": HALF_VIEW_DEG, "sees_site": True}
        )
        self._space: FreeSpace | None = None
        self._start = Pose(0.0, 0.0)
        self._robot_radius_m = 0.0
        self._parameters = ProtocolParameters()
        self._goal = ""
        self._known_views: dict[tuple[str, float, str, ViewCriteria], ViewPoints] = {}
        self._planner: LatticePlanner | None = None
        self._views: BoolGrid | None = None
        self._actions: tuple[Action, ...] = ()
        self._note = ""
        self._refused: list[Pose] = []
        self._before_move: Pose | None = None

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Receive the site, the start and the robot's base."""
        self._space = free_space(site, base.radius_m)
        self._start = start
        self._robot_radius_m, self._parameters = base.radius_m, parameters
        self._forget()

    def reset(self, goal: str, seed: int) -> None:  # noqa: ARG002 - it is deterministic
        """Start an episode towards `goal`."""
        self._goal = goal.id if isinstance(goal, Goal) else goal
        self._forget()

    def next_goal(self, goal: str) -> None:
        """Plan towards the next goal."""
        self.reset(goal, 0)

    def act(self, observation: Observation) -> Decision:
        """Return the next action of the plan, which is renewed if the last move or odometry contradicts it.

        Raises:
            ModelError: `survey` was never called.
        """
        if self._space is None:
            raise ModelError("the oracle needs the site", advice="call survey before the episode")
        here = self._start.compose(observation.pose)
        if self._before_move is not None:
            moved_m = here.distance_to(self._before_move)
            if moved_m < _NO_MOTION_SHARE * self._parameters.forward_m:
                self._refused.append(self._before_move)
                self._planner = None
        self._before_move = None
        if not self._plan_is_valid(here):
            self._make_plan(self._space, here, observation.camera.mount_height_m)
        if not self._actions:
            return Decision(Action.STOP, diagnostics=self._explain(here))
        decision = Decision(self._actions[0], diagnostics=self._explain(here))
        self._actions = self._actions[1:]
        if decision.action is Action.MOVE_FORWARD:
            self._before_move = here
        return decision

    def _forget(self) -> None:
        self._planner, self._views, self._actions, self._note = None, None, (), ""
        self._refused = []
        self._before_move = None

    def _plan_is_valid(self, here: Pose) -> bool:
        """Return whether the rest of the plan, from the robot's true pose, still ends at a view of the goal."""
        if self._planner is None or self._views is None or self._space is None:
            return False
        if self._planner.heading_error_rad(here.heading_rad) > _STALE_HEADING_RAD:
            return False
        poses = self._planner.follow(here, self._actions)
        if len(poses) <= len(self._actions):
            return False
        end = poses[-1]
        row, column = self._space.cell_of(*end.position)
        k = self._planner.nearest_heading(end.heading_rad)
        return bool(self._views[k, row - 1 : row + 2, column - 1 : column + 2].any())

    def _make_plan(self, space: FreeSpace, here: Pose, eye_height_m: float) -> None:
        """Plan with the largest clearance and the best view first, then with less."""
        parameters, guard = self._parameters, self._parameters.depth_guard
        turn_rad = math.radians(parameters.turn_deg)
        near_m = min(self._stop_within_m, 0.8 * parameters.success_distance_m)
        half_view_rad, farther_m = math.radians(HALF_VIEW_DEG), 0.9 * parameters.success_distance_m
        preferences = (
            (0.06, half_view_rad, ViewCriteria(near_m, eye_height_m)),
            (0.02, half_view_rad, ViewCriteria(near_m, eye_height_m)),
            (0.01, math.pi, ViewCriteria(farther_m, eye_height_m, in_sight=False, walls_hide=parameters.in_sight)),
        )
        refusals = (self._refused, []) if self._refused else ([],)
        for refused, (spare_m, half_view_rad, criteria) in itertools.product(refusals, preferences):
            clearance = NeededSpace(self._robot_radius_m, spare_m, guard.distance_m + 0.02, guard.margin_m + 0.01)
            planner = LatticePlanner(space, here.heading_rad, parameters.forward_m, turn_rad, clearance)
            for pose in refused:
                planner.forbid(pose)
            points = self._view_points(space, criteria)
            views = target_poses(space, planner, points, half_view_rad)
            actions = planner.plan(here, views) if views.any() else None
            if actions is not None:
                follower = LatticePlanner(
                    space, here.heading_rad, parameters.forward_m, turn_rad, clearance.eased(_DRIFT_M)
                )
                for pose in refused:
                    follower.forbid(pose)
                self._planner, self._views, self._actions, self._note = follower, views, actions, ""
                return
        self._planner, self._views, self._actions = None, None, ()
        self._note = f"no path to a {self._goal} on the map"

    def _view_points(self, space: FreeSpace, criteria: ViewCriteria) -> ViewPoints:
        definition = definition_sha256(space.site, self._goal)
        key = (f"{space.site.sha256}{definition}", self._robot_radius_m, self._goal, criteria)
        if key not in self._known_views:
            self._known_views[key] = view_points(space, self._goal, criteria)
        return self._known_views[key]

    def _explain(self, here: Pose) -> Diagnostics:
        """Return the planned path in the frame of the episode's start."""
        if self._planner is None:
            return Diagnostics(note=self._note or "at the goal")
        poses = self._planner.follow(here, self._actions)
        path = tuple(pose.relative_to(self._start).position for pose in poses)
        return Diagnostics(
            sub_goal=path[-1], path=path, scalars={"actions_left": float(len(self._actions) + 1)}, note=self._note
        )
