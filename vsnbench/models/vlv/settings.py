"""What can be chosen about VLV; where the paper and the original source differ, the paper's choice is the default."""

from enum import StrEnum
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from vsnbench.sensing.occupancy_map import MappingSettings


class DetectorKind(StrEnum):
    """What finds objects in an image."""

    AUTO = "auto"
    """Mask R-CNN where its weights are found, else an ONNX file, else the simulator's own labels."""
    MASK_RCNN = "mask_rcnn"
    ONNX = "onnx"
    SIMULATED = "simulated"
    """Not a detector at all: the simulator's own labels, made worse. Only in simulation."""


class ScanDirection(StrEnum):
    """Which way the robot turns while it looks around."""

    LEFT = "left"
    """As the original."""
    ALTERNATE = "alternate"
    """Left, then right, and so on: an odometry that counts turns too long or too short errs less in the end."""


class SubGoalRule(StrEnum):
    """How far from the node a short-term goal lies."""

    FIXED = "fixed"
    """At `sub_goal_m` straight in the direction of the view (paper, Section 3.2.1), nearer where that is blocked."""
    SAMPLED = "sampled"
    """Drawn between `sub_goal_min_m` and `sub_goal_max_m`, as in the original source."""


class VLVSettings(BaseModel):
    """The settings file of VLV."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # Detector
    detector: DetectorKind = Field(default=DetectorKind.AUTO, description="auto, mask_rcnn, onnx or simulated")
    detector_weights: str | None = Field(
        default=None,
        description="the detector file; else vlv_mask_rcnn.pth or vlv_detector.onnx in $VSNBENCH_WEIGHTS",
    )
    detector_threshold: float = Field(default=0.5, gt=0, lt=1, description="lower scores are no detection")
    simulated_recall: float = Field(
        default=0.85, ge=0, le=1, description="simulated detector: share of the visible objects that it finds"
    )
    simulated_precision: float = Field(
        default=0.92, gt=0, le=1, description="simulated detector: share of its detections that are right"
    )
    simulated_range_m: float = Field(
        default=5.0, gt=0, le=50, description="simulated detector: farther objects are never found"
    )
    simulated_min_area: float = Field(
        default=0.002, ge=0, le=1, description="simulated detector: share of the image an object must fill"
    )
    simulated_box_error: float = Field(
        default=0.03,
        ge=0,
        le=1,
        description="simulated detector: standard deviation of a box's edge, share of its size",
    )

    # High level
    scan_turns: int = Field(default=12, ge=1, le=72, description="turns of one look around")
    scan_direction: ScanDirection = Field(default=ScanDirection.LEFT, description="left or alternate")
    scan_ends_on_goal: bool = Field(
        default=True, description="two sightings of the goal at one place end the look around; the original finishes it"
    )
    sub_goal: SubGoalRule = Field(default=SubGoalRule.FIXED, description="fixed (paper) or sampled (source)")
    sub_goal_m: float = Field(default=1.5, gt=0.2, le=10, description="distance of a fixed sub-goal from its node")
    sub_goal_min_m: float = Field(default=0.9, gt=0.2, le=10, description="nearest sampled sub-goal")
    sub_goal_max_m: float = Field(default=2.0, gt=0.2, le=10, description="farthest sampled sub-goal")
    sub_goal_half_angle_deg: float = Field(
        default=7.0, ge=0, le=90, description="a sampled sub-goal lies within this angle of the view's direction"
    )
    sub_goal_way_m: float = Field(default=3.0, gt=0, le=50, description="longest way from the node to its sub-goal")
    detection_bonus: float = Field(
        default=1.0, ge=0, le=100, description="added to value and confidence of a view that shows the goal"
    )
    nearness_weight: float = Field(default=0.5, ge=0, le=100, description="weight of near candidates over far ones")
    nearness_reach_m: float = Field(default=10.0, gt=0, le=1000, description="way at which nearness counts nothing")
    novelty_weight: float = Field(
        default=1.0,
        ge=0,
        le=100,
        description="without a value network: weight of how much unknown lies around a candidate; 0 as the original",
    )
    visited_radius_m: float = Field(
        default=0.9, ge=0, le=10, description="candidates nearer than this to where the robot has been are dropped"
    )
    seek_on_sight: bool = Field(
        default=True,
        description="go on towards a goal that was seen by its depth; false: only the sub-goal in its direction",
    )

    # STOP
    stop_distance_m: float = Field(
        default=0.9, gt=0.1, le=10, description="STOP needs the goal nearer than this by its depth"
    )
    stop_looks: int = Field(default=2, ge=1, le=10, description="observations in a row that must confirm it")

    # Map
    resolution_m: float = Field(default=0.05, gt=0.01, le=0.5, description="side of a map cell")
    map_range_m: float = Field(default=5.0, gt=0.5, le=30, description="farther depth is not drawn into the map")
    obstacle_bottom_m: float = Field(default=0.2, ge=0, le=1, description="lower points are floor")
    obstacle_top_m: float | None = Field(
        default=1.2,
        gt=0,
        le=3,
        description="higher points pass above the robot; as high as the depth guard looks. null: the camera's height, "
        "as the original, which sees no table tops",
    )
    obstacle_points: int = Field(default=2, ge=1, le=1000, description="points that make a cell an obstacle")

    # Robot and low level
    robot_radius_m: float = Field(default=0.177, gt=0.02, le=1, description="radius of the base")
    clearance_m: float = Field(default=0.05, ge=0, le=1, description="wanted beside the radius, where there is room")
    forward_m: float = Field(default=0.25, gt=0.01, le=2, description="length of MOVE_FORWARD")
    turn_deg: float = Field(default=30.0, gt=1, le=180, description="angle of TURN_LEFT and TURN_RIGHT")
    look_ahead_m: float = Field(
        default=0.40, ge=0, le=2, description="free way ahead of the front without which a forward move is refused"
    )
    short_move_m: float = Field(
        default=0.24, ge=0, le=2, description="a forward move shorter than this marks an obstacle ahead"
    )
    replan_growth_m: float = Field(
        default=0.1,
        ge=0,
        le=10,
        description="the sub-goal is given up for another when its way grows by more than this",
    )
    budget_factor: float = Field(default=2.0, ge=1, le=100, description="actions for a sub-goal, times its way")
    budget_extra: int = Field(default=6, ge=0, le=1000, description="actions for a sub-goal, added")

    @property
    def mapping(self) -> MappingSettings:
        """How depth becomes the cells of the map."""
        return MappingSettings(
            resolution_m=self.resolution_m,
            range_m=self.map_range_m,
            obstacle_bottom_m=self.obstacle_bottom_m,
            obstacle_top_m=self.obstacle_top_m,
            obstacle_points=self.obstacle_points,
            robot_radius_m=self.robot_radius_m,
        )

    @model_validator(mode="after")
    def _sampled_range_is_one(self) -> Self:
        if self.sub_goal_min_m > self.sub_goal_max_m:
            raise ValueError("sub_goal_min_m is larger than sub_goal_max_m")
        return self
