"""The floor plan of an episode in Rerun: the site, the goal's success zone, the robot, and what the policy believes.

Everything under `plan` is logged in the site's frame (metres, y up). The entity itself carries the flip that makes
up be up, because a 2D view of Rerun draws y downwards.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from vsnbench.protocol.judge import Verdict, distance_to_goal, success_region
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.pose import Pose
from vsnbench.protocol.site import Site
from vsnbench.record.entries import EpisodeHeader, StepEntry
from vsnbench.viewer.entity_log import EntityLog
from vsnbench.viewer.site_picture import GOAL_EDGE_RGB, PLAN_PIXEL_M, outline, paint_site
from vsnbench.viewer.still_entities import StillEntities, still_entities

if TYPE_CHECKING:
    import rerun as rr
    from shapely.geometry.base import BaseGeometry

START_RGB = (60, 60, 64)
ROBOT_RGB = (24, 92, 190)
SUCCESS_RGB = (22, 140, 62)
FAILURE_RGB = (206, 44, 40)
VOID_RGB = (150, 120, 30)
POLICY_RGB = (150, 60, 170)
MAP_CLASSES = [(0, "unknown", (0, 0, 0, 0)), (1, "free", (110, 180, 250, 255)), (2, "occupied", (*POLICY_RGB, 255))]

_ANGLES_RAD = np.linspace(0.0, math.tau, 33)
_UNIT_CIRCLE = np.stack([np.cos(_ANGLES_RAD), np.sin(_ANGLES_RAD)], axis=1)


class FloorPlan:
    """Draws one episode's plan into a recording."""

    def __init__(self, log: EntityLog, header: EpisodeHeader) -> None:
        self._log = log
        self._header = header
        self._here = header.begin
        self._showing: frozenset[str] = frozenset()

    def draw_site(self) -> None:
        """Log everything that stands still: the site with the goal's instances and their zone, and the start."""
        import rerun as rr

        header, stream = self._header, self._log.stream
        site, goal, parameters = header.site, header.goal, header.parameters
        key = ("site", site.sha256, goal, parameters)
        still_entities(key, lambda entities: _draw_site(entities, site, goal, parameters)).send(stream)
        stream.log(
            "plan/start",
            rr.Arrows2D.from_fields(
                **_heading_arrow(header.begin.pose, START_RGB, 0.35), labels=[f"start {header.start_number}"]
            ),
            static=True,
        )

    def draw_step(self, entry: StepEntry) -> float | None:
        """Log the robot where the image was taken, the way it then went, and the policy's picture of the world.

        Returns:
            The distance from there to the goal, metres; None when the site has none.
        """
        import rerun as rr

        header = self._header
        here = self._here.pose
        self._draw_robot(here)
        if entry.step.world is not None:
            there = entry.step.world.pose
            progress = min(1.0, entry.step.number / header.parameters.max_actions)
            if here.distance_to(there) > 1e-4:
                self._log.put(
                    "plan/trajectory",
                    rr.LineStrips2D,
                    strips=[[here.position, there.position]],
                    colors=[_warming(progress)],
                    radii=[0.03],
                )
        self._mark_trouble(entry)
        self._draw_beliefs(entry)
        distance = distance_to_goal(header.site, header.goal, self._here, header.parameters).distance_m
        if entry.step.world is not None:
            self._here = entry.step.world
        return distance

    def draw_end(self, verdict: Verdict) -> None:
        """Log where it ended, in the colour of the verdict."""
        import rerun as rr

        here = self._here.pose
        self._draw_robot(here)
        color = VOID_RGB if verdict.success is None else SUCCESS_RGB if verdict.success else FAILURE_RGB
        label = verdict.end_reason.value.replace("_", " ")
        self._log.stream.log(
            "plan/end", rr.Points2D([here.position], colors=color, radii=0.08, labels=[label], draw_order=50.0)
        )

    def _draw_robot(self, here: Pose) -> None:
        import rerun as rr

        shell = _circle(here, self._header.robot_radius_m)
        self._log.put("plan/robot/shell", rr.LineStrips2D, strips=[shell], colors=[ROBOT_RGB], radii=[0.025])
        self._log.put("plan/robot/heading", rr.Arrows2D, **_heading_arrow(here, ROBOT_RGB, 0.45))

    def _mark_trouble(self, entry: StepEntry) -> None:
        import rerun as rr

        collided = entry.step.result is not None and entry.step.result.collision is not None
        if not (entry.step.blocked or collided):
            return
        pose = entry.step.world.pose if entry.step.world is not None and collided else self._here.pose
        nose = pose.compose(Pose(self._header.robot_radius_m, 0.0)).position
        self._log.put(
            f"plan/{'collision' if collided else 'blocked'}",
            rr.Points2D,
            positions=[nose],
            colors=[FAILURE_RGB if collided else VOID_RGB],
            radii=[0.08 if collided else 0.05],
        )

    def _draw_beliefs(self, entry: StepEntry) -> None:
        """Log the policy's map, nodes, path and sub-goal, carried from the start's frame into the site's."""
        import rerun as rr

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
        self._show("plan/policy/nodes", rr.Points2D, positions=points, radii=[0.04])
        way = (
            [[begin.compose(Pose(*point)).position for point in diagnostics.path]] if len(diagnostics.path) > 1 else []
        )
        self._show("plan/policy/path", rr.LineStrips2D, strips=way, radii=[0.02])
        target = [] if diagnostics.sub_goal is None else [begin.compose(Pose(*diagnostics.sub_goal)).position]
        self._show("plan/policy/sub_goal", rr.Points2D, positions=target, radii=[0.08])

    def _show(self, entity: str, archetype: "type[rr.AsComponents]", **components: Sequence[object]) -> None:
        """Put what there is, and nothing at all for a policy that never has any."""
        is_there = all(components.values())
        if is_there or entity in self._showing:
            self._log.put(entity, archetype, **components, colors=[POLICY_RGB])
        self._showing = self._showing | {entity} if is_there else self._showing - {entity}


def _draw_site(entities: StillEntities, site: Site, goal: str, parameters: ProtocolParameters) -> None:
    """Log rooms, walls, furniture, the goal's instances and from where STOP succeeds at them."""
    import rerun as rr

    log = entities.log
    log("plan", rr.Transform3D(scale=[1.0, -1.0, 1.0]), static=True)
    log("plan/policy/map", rr.AnnotationContext(MAP_CLASSES), static=True)
    picture, corner = paint_site(site, goal)
    height = picture.shape[0] * PLAN_PIXEL_M
    # The picture's rows run down: flipped back, its corner is the upper left one.
    log(
        "plan/site",
        rr.Transform3D(translation=[corner[0], corner[1] + height, 0.0], scale=[PLAN_PIXEL_M, -PLAN_PIXEL_M, 1.0]),
        rr.Image(picture, draw_order=-10.0).compress(jpeg_quality=95),
        static=True,
    )
    goals = site.instances(goal)
    log(
        "plan/goal/instances",
        rr.LineStrips2D([outline(thing.shape) for thing in goals], colors=GOAL_EDGE_RGB, radii=0.02),
        static=True,
    )
    log(
        "plan/goal/labels",
        rr.Points2D(
            [thing.position for thing in goals],
            labels=[thing.id for thing in goals],
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


def _warming(progress: float) -> tuple[int, int, int]:
    """Blue at the start of an episode, red at the action cap."""
    cold, warm = np.array([30, 100, 220]), np.array([225, 60, 40])
    red, green, blue = (cold + (warm - cold) * progress).round().astype(int)
    return int(red), int(green), int(blue)
