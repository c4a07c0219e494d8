"""The floor plan of an episode in Rerun: site, success zone, robot, and diagnostics of the policy.

Entities under `plan` use the site's frame, metres with y up. The entity `plan` flips y, because Rerun's 2D views draw
y downwards.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import rerun as rr

from vsnbench.palette import FAILURE, SUCCESS, VOID, rgb
from vsnbench.protocol.judge import Verdict, distance_to_goal, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.episode_entries import EpisodeHeader, StepEntry
from vsnbench.sites.site import Site
from vsnbench.sites.targets import targets_of
from vsnbench.values.pose import Pose
from vsnbench.values.step import StepRecord, image_offset
from vsnbench.viewer.entity_log import EntityLog
from vsnbench.viewer.site_picture import GOAL_EDGE_RGB, PLAN_PIXEL_M, outline, paint_site
from vsnbench.viewer.static_entities import StaticEntities, cached_entities

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

START_RGB = (60, 60, 64)
ROBOT_RGB = (24, 92, 190)
SUCCESS_RGB, FAILURE_RGB, VOID_RGB = rgb(SUCCESS), rgb(FAILURE), rgb(VOID)
POLICY_RGB = (150, 60, 170)
MAP_CLASSES = [(0, "unknown", (0, 0, 0, 0)), (1, "free", (110, 180, 250, 255)), (2, "occupied", (*POLICY_RGB, 255))]

_ANGLES_RAD = np.linspace(0.0, math.tau, 33)
_UNIT_CIRCLE = np.stack([np.cos(_ANGLES_RAD), np.sin(_ANGLES_RAD)], axis=1)


class FloorPlan:
    """Logs the plan of one episode."""

    def __init__(self, log: EntityLog, header: EpisodeHeader) -> None:
        self._log = log
        self._header = header
        self._robot = header.begin
        self._odometry = Pose(0.0, 0.0)
        """Where the robot is."""
        self._present: frozenset[str] = frozenset()
        """Diagnostics that are shown now."""

    def draw_site(self) -> None:
        """Log the static parts: site, goal instances, success zone and start."""
        header, stream = self._header, self._log.stream
        site, goal, parameters = header.site, header.goal, header.parameters
        key = ("site", site.sha256, goal, parameters)
        cached_entities(key, lambda entities: _draw_site(entities, site, goal, parameters)).send(stream)
        stream.log(
            "plan/start",
            rr.Arrows2D.from_fields(
                **_heading_arrow(header.begin.pose, START_RGB, 0.35), labels=[f"start {header.start_number}"]
            ),
            static=True,
        )

    def draw_step(self, entry: StepEntry) -> float | None:
        """Log the robot at the image, its path during the action, and the policy's diagnostics.

        Returns:
            Distance to the goal at the image in metres, or None if the site has no instance of it.
        """
        header = self._header
        here = self._robot.pose
        seen_from = here.compose(image_offset(entry.step, self._odometry))
        self.draw_robot(seen_from)
        if entry.step.world is not None:
            there = entry.step.world.pose
            progress = min(1.0, _used(entry.step, header.parameters))
            if here.distance_to(there) > 1e-4:
                self._log.log(
                    "plan/trajectory",
                    rr.LineStrips2D,
                    strips=[[here.position, there.position]],
                    colors=[_progress_color(progress)],
                    radii=[0.03],
                )
        self._log_contact(entry)
        self._log_diagnostics(entry)
        fix = replace(self._robot, pose=seen_from)
        distance = distance_to_goal(header.site, header.goal, fix, header.parameters).distance_m
        if entry.step.world is not None:
            self._robot = entry.step.world
        self._odometry = entry.step.after or self._odometry
        return distance

    def draw_end(self, verdict: Verdict) -> None:
        """Log the end position in the colour of the verdict."""
        here = self._robot.pose
        self.draw_robot(here)
        color = VOID_RGB if verdict.success is None else SUCCESS_RGB if verdict.success else FAILURE_RGB
        label = verdict.end_reason.value.replace("_", " ")
        self._log.stream.log(
            "plan/end", rr.Points2D([here.position], colors=color, radii=0.08, labels=[label], draw_order=50.0)
        )

    def draw_robot(self, here: Pose) -> None:
        """Log where the robot is."""
        shell = _circle(here, self._header.robot_radius_m)
        self._log.log("plan/robot/shell", rr.LineStrips2D, strips=[shell], colors=[ROBOT_RGB], radii=[0.025])
        self._log.log("plan/robot/heading", rr.Arrows2D, **_heading_arrow(here, ROBOT_RGB, 0.45))

    def _log_contact(self, entry: StepEntry) -> None:
        collided = entry.step.result is not None and entry.step.result.collision is not None
        if not (entry.step.blocked or collided):
            return
        pose = entry.step.world.pose if entry.step.world is not None and collided else self._robot.pose
        nose = pose.compose(Pose(self._header.robot_radius_m, 0.0)).position
        self._log.log(
            f"plan/{'collision' if collided else 'blocked'}",
            rr.Points2D,
            positions=[nose],
            colors=[FAILURE_RGB if collided else VOID_RGB],
            radii=[0.08 if collided else 0.05],
        )

    def _log_diagnostics(self, entry: StepEntry) -> None:
        """Log the policy's map, nodes, path and sub-goal, transformed from the start's frame to the site's."""
        begin = self._header.begin.pose
        diagnostics = entry.decision.diagnostics
        if diagnostics.map is not None:
            corner = begin.compose(Pose(diagnostics.map.origin_x_m, diagnostics.map.origin_y_m))
            resolution = diagnostics.map.resolution_m
            turn = np.array(
                [
                    [math.cos(begin.heading_rad), -math.sin(begin.heading_rad), 0.0],
                    [math.sin(begin.heading_rad), math.cos(begin.heading_rad), 0.0],
                    [0.0, 0.0, 1.0],
                ]
            )
            self._log.stream.log(
                "plan/policy/map",
                rr.Transform3D(
                    translation=[*corner.position, 0.0], mat3x3=turn @ np.diag([resolution, resolution, 1.0])
                ),
                rr.SegmentationImage(diagnostics.map.cells, opacity=0.55, draw_order=-5.0),
            )
        points = [begin.compose(Pose(*point)).position for point in diagnostics.nodes]
        self._log_optional("plan/policy/nodes", rr.Points2D, positions=points, radii=[0.04])
        path = (
            [[begin.compose(Pose(*point)).position for point in diagnostics.path]] if len(diagnostics.path) > 1 else []
        )
        self._log_optional("plan/policy/path", rr.LineStrips2D, strips=path, radii=[0.02])
        target = [] if diagnostics.sub_goal is None else [begin.compose(Pose(*diagnostics.sub_goal)).position]
        self._log_optional("plan/policy/sub_goal", rr.Points2D, positions=target, radii=[0.08])

    def _log_optional(self, entity: str, archetype: type[rr.AsComponents], **components: Sequence[object]) -> None:
        """Log an entity, or its removal if it was there before."""
        is_present = all(components.values())
        if is_present or entity in self._present:
            self._log.log(entity, archetype, **components, colors=[POLICY_RGB])
        self._present = self._present | {entity} if is_present else self._present - {entity}


def _used(step: StepRecord, parameters: ProtocolParameters) -> float:
    """Return the share of an episode's actions, or of its time, that a step has used."""
    if parameters.action_limit is not None:
        return step.number / parameters.action_limit
    return (step.stamp_s or 0.0) / (parameters.time_limit_s or math.inf)


def _draw_site(entities: StaticEntities, site: Site, goal: str, parameters: ProtocolParameters) -> None:
    """Log the plan, the goal's targets and the zone in which STOP succeeds."""
    log = entities.log
    log("plan", rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
    log("plan/policy/map", rr.AnnotationContext(MAP_CLASSES), static=True)
    picture, corner = paint_site(site, goal)
    height = picture.shape[0] * PLAN_PIXEL_M
    # Image rows run downwards, so the image is flipped about its upper left corner.
    log(
        "plan/site",
        rr.Transform3D(translation=[corner[0], corner[1] + height, 0.0], scale=[PLAN_PIXEL_M, -PLAN_PIXEL_M, 1.0]),
        rr.Image(picture, draw_order=-10.0).compress(jpeg_quality=95),
        static=True,
    )
    from shapely import Polygon

    targets = targets_of(site, goal)
    centres = [target.shape.centroid for target in targets]
    log(
        "plan/goal/instances",
        rr.LineStrips2D(
            [outline(target.shape) for target in targets if isinstance(target.shape, Polygon)],
            colors=GOAL_EDGE_RGB,
            radii=0.02,
        ),
        static=True,
    )
    log(
        "plan/goal/labels",
        rr.Points2D(
            [
                target.thing.position if target.thing is not None else (centre.x, centre.y)
                for target, centre in zip(targets, centres, strict=True)
            ],
            labels=[target.id for target in targets],
            colors=GOAL_EDGE_RGB,
            radii=0.03,
        ),
        static=True,
    )
    log(
        "plan/goal/success_zone",
        rr.LineStrips2D(_rings(success_region(site, goal, parameters)), colors=GOAL_EDGE_RGB, radii=0.012),
        static=True,
    )


def _rings(zone: "BaseGeometry") -> list[list[tuple[float, float]]]:
    parts = getattr(zone, "geoms", [zone])
    return [
        [(float(x), float(y)) for x, y in ring.coords]
        for part in parts
        if not part.is_empty
        for ring in (part.exterior, *part.interiors)
    ]


def _circle(pose: Pose, radius_m: float) -> npt.NDArray[np.float64]:
    return np.array(pose.position) + radius_m * _UNIT_CIRCLE


def _heading_arrow(pose: Pose, rgb: tuple[int, int, int], length_m: float) -> dict[str, Sequence[object]]:
    vector = (length_m * math.cos(pose.heading_rad), length_m * math.sin(pose.heading_rad))
    return {"origins": [pose.position], "vectors": [vector], "colors": [rgb], "radii": [0.03]}


def _progress_color(progress: float) -> tuple[int, int, int]:
    """Return a colour from blue at the start of an episode to red at the action limit."""
    cold, warm = np.array([30, 100, 220]), np.array([225, 60, 40])
    red, green, blue = (cold + (warm - cold) * progress).round().astype(int)
    return int(red), int(green), int(blue)
