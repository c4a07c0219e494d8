"""One episode of VLV: scan, choose a direction, drive there, scan again; approach the goal once it has been seen."""

import math
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from vsnbench.models.vlv.detectors.contract import Detection, Reliability
from vsnbench.models.vlv.goal_memory import GoalMemory, GoalPlace, GoalSurface, surface_of
from vsnbench.models.vlv.map_regions import disk, frontier_away_from, in_sight
from vsnbench.models.vlv.planner import BoolGrid, FloatGrid, Planner, Point, path_of, value_at
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.models.vlv.sub_goals import sub_goal_of, unknown_around
from vsnbench.models.vlv.swath import obstacles_ahead
from vsnbench.models.vlv.topological_graph import Candidate, TopologicalGraph
from vsnbench.sensing.occupancy_map import OccupancyMap
from vsnbench.values.decision import Decision, Diagnostics
from vsnbench.values.movement import Action
from vsnbench.values.observation import Observation
from vsnbench.values.pose import Pose, wrap_angle

_ARRIVED_M: Final = 0.25
_APPROACH_MARGIN_M: Final = 0.15
"""Reserve when approaching the goal, because odometry and depth have errors."""
_NO_MOTION_M: Final = 0.05
_SURELY_SEEN_M: Final = 4.0
"""A visible goal within this distance should be detected; an observation without it is a miss."""
_SURFACE_M: Final = 0.3
"""The line of sight to a surface can end this far before it."""
_MAX_FAILED_OBSERVATIONS: Final = 6
"""A place is dropped after this number of observations from nearby without a detection."""
_VIEW_BORDER_RAD: Final = math.radians(10.0)
_MAX_RECORDED_CANDIDATES: Final = 30


Mode = Literal["scan", "travel", "seek", "stop"]
"""Activity of the policy."""


def explained(
    action: Action, mode: Mode, note: str, sub_goal: Point | None = None, path: tuple[Point, ...] = ()
) -> Decision:
    """Return a decision with the reason for it."""
    shown = Diagnostics(note=f"{mode}: {note}", sub_goal=sub_goal, path=path, details={"mode": mode})
    return Decision(action, diagnostics=shown)


class Search:
    """The state of an episode, from odometry, depth, detections and the value network only."""

    def __init__(
        self, settings: VLVSettings, planner: Planner, seed: int, reliability: Reliability, *, with_value: bool = False
    ) -> None:
        """Start an episode. Without a value network, candidates near unknown space are preferred."""
        self.settings = settings
        self._novelty_weight = 0.0 if with_value else settings.novelty_weight
        self.map = OccupancyMap(settings.mapping)
        self.graph = TopologicalGraph(settings)
        self.memory = GoalMemory(reliability)
        self._planner = planner
        self._random = np.random.default_rng(seed)
        self._confirmed = 0
        self._before_forward: Pose | None = None
        self._views: list[tuple[float, float, float]] = []
        """Heading of the camera in the start's frame, value and confidence of each view of the scan."""
        self._turns_left: int | None = None
        self._scans = 0
        self._target: Candidate | None = None
        self._budget = 0

    def step(self, observation: Observation, detections: tuple[Detection, ...], value: float) -> Decision:
        """Return the next action.

        Detections are those of the goal's class above the threshold, best first. The value is that of the view; 0
        without a value network.
        """
        depth_m = observation.depth_m
        if depth_m is None:
            raise ValueError("no depth image")
        pose = observation.pose
        self._note_last_move(pose, depth_m, observation)
        self.map.observe(depth_m, observation.camera, pose)
        sightings = [surface_of(detection, depth_m, observation.camera, pose) for detection in detections]
        self._remember(sightings, observation)
        reason = self._reason_to_stop(sightings, pose)
        if reason:
            return explained(Action.STOP, "stop", reason)
        self.graph.visit(pose.position)
        if self._turns_left is not None:
            confidence = max((detection.score for detection in detections), default=0.0)
            self._views.append((pose.heading_rad, value, confidence))
        move = self._decide(observation, depth_m)
        if move.action is Action.MOVE_FORWARD:
            self._before_forward = pose
        return move

    def _reason_to_stop(self, sightings: list[GoalSurface], pose: Pose) -> str:
        """Return why the robot is at the goal, or an empty string."""
        if self.memory.reliability.is_measured:
            reach_m = self.settings.stop_distance_m - _APPROACH_MARGIN_M
            near = [place for place in self.memory.believed if place.distance_m(pose.position) < reach_m]
            return f"at a place that {near[0].observations} views support" if near else ""
        distances_m = [item.distance_m for item in sightings if item.distance_m < self.settings.stop_distance_m]
        self._confirmed = self._confirmed + 1 if distances_m else 0
        if self._confirmed < self.settings.stop_looks:
            return ""
        return f"the goal is {min(distances_m):.2f} m away, confirmed {self._confirmed} times"

    # Results of the last move

    def _note_last_move(self, pose: Pose, depth_m: npt.NDArray[np.float32], observation: Observation) -> None:
        """Mark an obstacle if a forward move was too short."""
        before, self._before_forward = self._before_forward, None
        if before is None:
            return
        moved_m = before.distance_to(pose)
        if moved_m >= self.settings.short_move_m:
            return
        obstacles = obstacles_ahead(depth_m, observation.camera, pose, self.settings)
        # A refused move: an obstacle within the guarded distance. A short move: an obstacle at the front.
        ahead_m = self.settings.robot_radius_m + (
            self.settings.look_ahead_m / 2 if moved_m < _NO_MOTION_M else self.settings.resolution_m
        )
        half_m = self.settings.robot_radius_m / 2
        for point in obstacles or [
            pose.compose(Pose(ahead_m, aside_m)).position for aside_m in np.linspace(-half_m, half_m, 5)
        ]:
            self.map.mark_obstacle(*point, pose)

    def _remember(self, sightings: list[GoalSurface], observation: Observation) -> None:
        """Add the sightings of the goal to the memory, and count misses."""
        pose, camera = observation.pose, observation.camera
        half_view_rad = math.radians(camera.horizontal_fov_deg) / 2 - _VIEW_BORDER_RAD
        obstacles = self.map.occupied

        def should_see(point: Point) -> bool:
            bearing = wrap_angle(math.atan2(point[1] - pose.y_m, point[0] - pose.x_m) - pose.heading_rad)
            far_m = math.dist(point, pose.position)
            if abs(bearing) > half_view_rad or not camera.depth_min_m < far_m < _SURELY_SEEN_M:
                return False
            return in_sight(self.map, obstacles, pose.position, point, far_m - _SURFACE_M)

        self.memory.update(sightings, should_see)

    # Decisions

    def _decide(self, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        believed = self.memory.believed
        may_seek = self._turns_left in (None, 0) or self.settings.scan_ends_on_goal
        if believed and self.settings.seek_on_sight and may_seek:
            move = self._seek(believed, observation, depth_m)
            if move is not None:
                self._turns_left = None
                self._target = None
                return move
        return self._look_for_goal(observation, depth_m)

    def _look_for_goal(self, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        """Return the next action while the goal's place is unknown."""
        if self._turns_left is None and self._target is None:
            return self._begin_scan()
        if self._turns_left is not None:
            if self._turns_left > 0:
                return self._scan_turn()
            self._finish_scan(observation.pose)
        return self._travel(observation, depth_m)

    def _begin_scan(self) -> Decision:
        self._views = []
        self._scans += 1
        self._turns_left = self.settings.scan_turns
        return self._scan_turn()

    def _scan_turn(self) -> Decision:
        turns_left = self._turns_left or 0
        self._turns_left = turns_left - 1
        right = self.settings.scan_direction == "alternate" and self._scans % 2 == 0
        done = self.settings.scan_turns - turns_left + 1
        note = f"scan, turn {done} of {self.settings.scan_turns}"
        return explained(Action.TURN_RIGHT if right else Action.TURN_LEFT, "scan", note)

    def _finish_scan(self, pose: Pose) -> None:
        """Convert the views to candidates and choose a target."""
        self._turns_left = None
        terrain = self._planner.terrain(self.map, pose, self.settings.clearance_m)
        lengths_m = self._planner.lengths_from(terrain, pose)
        node = len(self.graph.nodes)
        candidates = []
        for heading_rad, value, confidence in self._views:
            point = sub_goal_of(pose.position, heading_rad, terrain, lengths_m, self.settings, self._random)
            if point is not None and not self.graph.is_visited(point):
                candidates.append(Candidate.of_view(point, node, value, confidence, self.settings))
        self.graph.add_node(pose.position, candidates)
        self._choose(pose)

    def _choose(self, pose: Pose) -> None:
        """Make the best open candidate the target; None if there is none."""
        self._target = None
        if not self.graph.open_candidates:
            return
        terrain = self._planner.terrain(self.map, pose, 0.0)
        lengths_m = self._planner.lengths_from(terrain, pose)
        known, obstacles = self.map.known, terrain.obstacles
        points = [candidate.point for candidate in self.graph.open_candidates]
        novelty = [
            self._novelty_weight * unknown_around(point, self.map, known, obstacles) if self._novelty_weight else 0.0
            for point in points
        ]
        best = self.graph.take_best([value_at(lengths_m, self.map, point) for point in points], novelty)
        if best is not None:
            self._target, way_m = best
            self._set_budget(way_m)

    def _set_budget(self, way_m: float) -> None:
        self._budget = math.ceil(
            self.settings.budget_factor * way_m / self.settings.forward_m + self.settings.budget_extra
        )

    def _travel(self, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        """Drive to the target, or to another one if that fails; scan if there is none."""
        pose = observation.pose
        for _ in range(1 + len(self.graph.open_candidates)):
            target = self._target
            if target is None:
                break
            if math.dist(target.point, pose.position) < _ARRIVED_M or self._budget <= 0:
                self._target = None
                return self._begin_scan()
            self._budget -= 1
            move = self._towards(disk(self.map, target.point, _ARRIVED_M / 2), observation, depth_m, "travel")
            if move is not None:
                reason = f"to a view of node {target.node}, score {target.score:.2f}"
                return explained(
                    move.action, "travel", f"{reason}, {self._budget} actions left", target.point, move.diagnostics.path
                )
            self._choose(pose)
        return self._explore(observation, depth_m)

    def _explore(self, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        """Without candidates, drive to the nearest frontier that has not been visited."""
        pose = observation.pose
        frontier = frontier_away_from(self.map, self.graph.visited, self.settings.visited_radius_m)
        if frontier.any():
            move = self._towards(frontier, observation, depth_m, "travel")
            if move is not None and move.diagnostics.path:
                end = move.diagnostics.path[-1]
                self._target = Candidate(end, len(self.graph.nodes) - 1, 0.0, 0.0, 0.0)
                self._set_budget(math.dist(end, pose.position))
                return explained(
                    move.action, "travel", "no candidates left: to the nearest frontier", end, move.diagnostics.path
                )
        return self._begin_scan()

    def _seek(
        self, places: list[GoalPlace], observation: Observation, depth_m: npt.NDArray[np.float32]
    ) -> Decision | None:
        """Approach the nearest place where the goal was seen, and observe it from there."""
        pose = observation.pose
        reach_m = self.settings.stop_distance_m - _APPROACH_MARGIN_M
        region = np.zeros(self.map.shape, np.bool_)
        for place in places:
            for x_m, y_m in place.points.tolist():
                region |= disk(self.map, (x_m, y_m), reach_m)
        here = self.map.cell_at(pose.x_m, pose.y_m)
        nearest = min(places, key=lambda place: place.nearest_m(pose.position))
        if region[here.row, here.column]:
            nearest.failed_observations += 1
            if nearest.failed_observations > _MAX_FAILED_OBSERVATIONS:
                self.memory.places.remove(nearest)
                return None
            return self._face(nearest, observation, depth_m)
        move = self._towards(region, observation, depth_m, "seek")
        if move is None:
            return None
        note = f"to the goal: {nearest.observations} observations, {nearest.misses} misses"
        return explained(move.action, "seek", note, nearest.centre, move.diagnostics.path)

    def _face(self, place: GoalPlace, observation: Observation, depth_m: npt.NDArray[np.float32]) -> Decision:
        """Turn to the nearby goal and keep it in view."""
        pose = observation.pose
        points = place.points
        near = points[np.argsort(np.hypot(*(points - pose.position).T))[: max(1, len(points) // 3)]]
        x_m, y_m = near.mean(axis=0)
        bearing = wrap_angle(math.atan2(y_m - pose.y_m, x_m - pose.x_m) - pose.heading_rad)
        turn_rad = math.radians(self.settings.turn_deg)
        note = "near the goal: turning to it"
        if abs(bearing) <= turn_rad / 2 + 1e-6 and not obstacles_ahead(
            depth_m, observation.camera, pose, self.settings
        ):
            terrain = self._planner.terrain(self.map, pose, 0.0)
            ahead = pose.compose(Pose(self.settings.forward_m, 0.0)).position
            if terrain.is_open(*ahead) and terrain.sees(pose.position, ahead):
                return explained(Action.MOVE_FORWARD, "seek", note, place.centre)
        return explained(Action.TURN_LEFT if bearing > 0 else Action.TURN_RIGHT, "seek", note, place.centre)

    def _towards(
        self, targets: BoolGrid, observation: Observation, depth_m: npt.NDArray[np.float32], mode: Mode
    ) -> Decision | None:
        """Return the next action towards some cells, with the largest clearance that leaves a path."""
        pose = observation.pose
        refused = False
        for _ in range(2):
            field_m: FloatGrid | None = None
            for share in (1.0, 0.5, 0.0):
                terrain = self._planner.terrain(self.map, pose, share * self.settings.clearance_m)
                field_m = self._planner.route(terrain, targets, pose)
                action = (
                    None
                    if field_m is None
                    else self._planner.next_action(terrain, field_m, pose, forward_refused=refused)
                )
                if action is not None:
                    break
            if field_m is None or action is None:
                return None
            if action is Action.MOVE_FORWARD:
                obstacles = obstacles_ahead(depth_m, observation.camera, pose, self.settings)
                if obstacles:
                    for point in obstacles:
                        self.map.mark_obstacle(*point, pose)
                    refused = True
                    continue
            return explained(action, mode, "", path=path_of(terrain, field_m, pose))
        return None

    def details(self) -> dict[str, Any]:
        """Return details for the record."""
        return {
            "candidates": [
                {
                    "x_m": round(candidate.point[0], 3),
                    "y_m": round(candidate.point[1], 3),
                    "node": candidate.node,
                    "value": round(candidate.value, 4),
                    "confidence": round(candidate.confidence, 4),
                    "score": round(candidate.score, 4),
                }
                for candidate in sorted(self.graph.open_candidates, key=lambda item: -item.score)[
                    :_MAX_RECORDED_CANDIDATES
                ]
            ],
            "edges": [[node, node + 1] for node in range(len(self.graph.nodes) - 1)],
            "goal_places": [
                {"x_m": round(place.centre[0], 3), "y_m": round(place.centre[1], 3)}
                | {"observations": place.observations, "misses": place.misses}
                for place in self.memory.places
            ],
        }
