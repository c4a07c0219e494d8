"""The settings of VLV. If the paper and the original source differ, the default is the paper's."""

from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from vsnbench.sensing.occupancy_map import MappingSettings

DetectorKind = Literal["auto", "mask_rcnn", "onnx", "simulated"]
"""Mask R-CNN, an ONNX file, or the simulator's labels with errors; `auto`: the first whose weights are found."""


class VLVSettings(BaseModel):
    """The settings file of VLV."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # Detector
    detector: DetectorKind = Field(default="auto", description="auto, mask_rcnn, onnx or simulated")
    detector_weights: str | None = Field(
        default=None,
        description="detector file; null: vlv_mask_rcnn.pth or vlv_detector.onnx in $VSNBENCH_WEIGHTS",
    )
    detector_threshold: float = Field(
        default=0.5,
        gt=0,
        lt=1,
        description="minimum score of a detection; if set, it replaces those of the detector's file",
    )
    simulated_recall: float = Field(
        default=0.85, ge=0, le=1, description="simulated detector: share of visible objects that it detects"
    )
    simulated_precision: float = Field(
        default=0.92, gt=0, le=1, description="simulated detector: share of correct detections"
    )
    simulated_range_m: float = Field(
        default=5.0, gt=0, le=50, description="simulated detector: maximum distance of detected objects"
    )
    simulated_min_area: float = Field(
        default=0.002, ge=0, le=1, description="simulated detector: minimum share of the image that an object fills"
    )
    simulated_box_error: float = Field(
        default=0.03,
        ge=0,
        le=1,
        description="simulated detector: standard deviation of a box's edges, as a share of its size",
    )

    # High level
    scan_turns: int = Field(default=12, ge=1, le=72, description="number of turns of a scan")
    scan_direction: Literal["left", "alternate"] = Field(default="left", description="left or alternate")
    """Direction of the turns of a scan: left as in the original, or left, then right, and so on, so that scale errors
    of odometry cancel."""
    scan_ends_on_goal: bool = Field(
        default=True, description="two sightings of the goal at a place end the scan; the original finishes it"
    )
    sub_goal: Literal["fixed", "sampled"] = Field(default="fixed", description="fixed (paper) or sampled (source)")
    """Distance of a short-term goal from its node: `sub_goal_m` in the direction of the view (paper, Section 3.2.1),
    nearer if that is blocked; or random between `sub_goal_min_m` and `sub_goal_max_m`, as in the original source."""
    sub_goal_m: float = Field(default=1.5, gt=0.2, le=10, description="distance of a fixed sub-goal from its node")
    sub_goal_min_m: float = Field(default=0.9, gt=0.2, le=10, description="nearest sampled sub-goal")
    sub_goal_max_m: float = Field(default=2.0, gt=0.2, le=10, description="farthest sampled sub-goal")
    sub_goal_half_angle_deg: float = Field(
        default=7.0, ge=0, le=90, description="maximum angle between a sampled sub-goal and the view's direction"
    )
    sub_goal_way_m: float = Field(
        default=3.0, gt=0, le=50, description="maximum path length from a node to its sub-goal"
    )
    detection_bonus: float = Field(
        default=1.0, ge=0, le=100, description="added to value and confidence of a view that shows the goal"
    )
    nearness_weight: float = Field(default=0.5, ge=0, le=100, description="weight of near candidates over far ones")
    nearness_reach_m: float = Field(
        default=10.0, gt=0, le=1000, description="path length at which nearness has no weight"
    )
    novelty_weight: float = Field(
        default=1.0,
        ge=0,
        le=100,
        description="weight of unknown space around a candidate, without a value network; 0 as in the original",
    )
    visited_radius_m: float = Field(
        default=0.9, ge=0, le=10, description="candidates nearer than this to a visited point are dropped"
    )
    seek_on_sight: bool = Field(
        default=True,
        description="drive to a goal's measured position; false: only to the sub-goal in its direction",
    )

    # STOP
    stop_distance_m: float = Field(
        default=0.9, gt=0.1, le=10, description="maximum measured distance to the goal for STOP"
    )
    stop_looks: int = Field(
        default=2, ge=1, le=10, description="number of consecutive observations that must confirm it"
    )

    # Map
    resolution_m: float = Field(default=0.05, gt=0.01, le=0.5, description="side of a map cell")
    map_range_m: float = Field(default=5.0, gt=0.5, le=30, description="maximum depth that is entered into the map")
    obstacle_bottom_m: float = Field(default=0.2, ge=0, le=1, description="lower points are floor")
    obstacle_top_m: float | None = Field(
        default=1.2,
        gt=0,
        le=3,
        description="higher points are above the robot; the depth guard has the same limit. null: the camera's height, "
        "as in the original, which misses table tops",
    )
    obstacle_points: int = Field(default=2, ge=1, le=1000, description="number of points that make a cell an obstacle")

    # Robot and low level
    robot_radius_m: float = Field(default=0.177, gt=0.02, le=1, description="radius of the base")
    clearance_m: float = Field(
        default=0.05, ge=0, le=1, description="clearance in addition to the radius, if there is room"
    )
    forward_m: float = Field(default=0.25, gt=0.01, le=2, description="length of MOVE_FORWARD")
    turn_deg: float = Field(default=30.0, gt=1, le=180, description="angle of TURN_LEFT and TURN_RIGHT")
    look_ahead_m: float = Field(
        default=0.40, ge=0, le=2, description="free distance ahead of the front that a forward move needs"
    )
    short_move_m: float = Field(
        default=0.24, ge=0, le=2, description="a forward move shorter than this marks an obstacle ahead"
    )
    budget_factor: float = Field(
        default=2.0, ge=1, le=100, description="actions for a sub-goal, per action of its shortest path"
    )
    budget_extra: int = Field(default=6, ge=0, le=1000, description="additional actions for a sub-goal")

    @property
    def mapping(self) -> MappingSettings:
        """Settings of the occupancy map."""
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
