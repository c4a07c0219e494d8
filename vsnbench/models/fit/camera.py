"""The camera that a model was trained with against the robot's: differences, and images cropped for the model."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.task import Task
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.site import Site
from vsnbench.values.camera import Camera
from vsnbench.values.decision import Box, Decision
from vsnbench.values.decision_check import checked_decision
from vsnbench.values.model.trained_camera import CameraDifference, cropped, part_of
from vsnbench.values.movement import Action, Movement, Pixel
from vsnbench.values.observation import ARRAYS, InstanceImage, Observation, with_changes
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

Array = TypeVar("Array", bound=npt.NDArray[Any])

FIT_KEY: Final = "fit"
"""Name of the condition of runs with fitted images."""


class Fit(StrEnum):
    """Images that a model receives."""

    FULL = "full"
    """The robot's."""
    CROP = "crop"
    """Their central part with the field of view that the model was trained with."""


def camera_differences(card: ModelCard, camera: Camera) -> tuple[CameraDifference, ...]:
    """Return how a robot's camera differs from the camera on a card; none if the card states none."""
    return card.camera.differences(camera) if card.camera is not None else ()


def difference_text(card: ModelCard, robot: str, camera: Camera) -> str:
    """Return the differences in one line; empty without any."""
    found = camera_differences(card, camera)
    if not found:
        return ""
    return (
        f"the camera of robot {robot} is not the one that model {card.name} was trained with: "
        f"{', '.join(difference.text for difference in found)}"
    )


def comparison_text(card: ModelCard, robot: str, camera: Camera) -> str:
    """Return the result of the comparison in one line, also without differences."""
    if card.camera is None:
        return f"not compared with robot {robot}: the card of model {card.name} states no camera"
    return difference_text(card, robot, camera) or f"like that of robot {robot}: {card.camera.text}"


def crop_for(card: ModelCard, robot: str, camera: Camera) -> Camera:
    """Return the part of a robot's camera view that a model was trained with.

    Raises:
        UsageError: the card states no field of view, or the robot's is narrower.
    """
    if card.camera is None or card.camera.horizontal_fov_deg is None:
        raise UsageError(
            f'models.fit = "crop": the card of model {card.name} states no field of view',
            advice="state it in the card's `camera`, or remove models.fit from vsnbench.toml",
            code="no-trained-camera",
        )
    try:
        return cropped(card.camera, camera)
    except ValueError as error:
        raise UsageError(
            f'models.fit = "crop": the camera of robot {robot} sees {error} that model {card.name} was trained with',
            advice="an image can only be narrowed: use a wider camera, or remove models.fit from vsnbench.toml",
            code="narrower-camera",
        ) from error


def crop_condition(crop: Camera) -> Mapping[str, Any]:
    """Return the condition of a run whose images are cropped."""
    size = {"width": crop.width, "height": crop.height, "horizontal_fov_deg": round(crop.horizontal_fov_deg, 3)}
    return {FIT_KEY: Fit.CROP.value, "crop": size}


class CroppedPolicy(Policy):
    """A policy that receives cropped images and their camera. Depth guard, judge and record use the robot's images."""

    def __init__(self, policy: Policy, camera: Camera, crop: Camera) -> None:
        """Wrap a policy, which receives the part `crop` of the view of the robot's camera."""
        self._policy, self._camera, self._crop = policy, camera, crop
        self.card, self.needs_survey = policy.card, policy.needs_survey

    def survey(self, site: Site, start: Pose, base: Base, parameters: ProtocolParameters) -> None:
        """Pass the site on."""
        self._policy.survey(site, start, base, parameters)

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""
        self._policy.reset(goal, seed)

    def begin(self, task: Task) -> None:
        """Start an episode with the cropped camera in the task."""
        camera = part_of(task.robot.camera, self._crop.width, self._crop.height)  # with the mount of the task
        self._policy.begin(replace(task, robot=replace(task.robot, camera=camera)))

    def next_goal(self, goal: str) -> None:
        """Pass the next goal of a sequence on."""
        self._policy.next_goal(goal)

    def act(self, observation: Observation) -> Decision:
        """Return the decision for the cropped observation, with pixels and boxes of the robot's image."""
        camera = observation.camera
        crop = part_of(
            camera,
            _side(camera.width, self._camera.width, self._crop.width),
            _side(camera.height, self._camera.height, self._crop.height),
        )
        left, top = (camera.width - crop.width) // 2, (camera.height - crop.height) // 2
        return _shifted(checked_decision(self._policy.act(self._cropped(observation, crop))), left, top)

    def end_episode(self) -> None:
        """Pass the end of the episode on."""
        self._policy.end_episode()

    def close(self) -> None:
        """Close the policy."""
        self._policy.close()

    def _cropped(self, observation: Observation, camera: Camera) -> Observation:
        given = observation.__getstate__()
        changes: dict[str, Any] = {"camera": camera}
        changes["history"] = tuple(self._cropped(earlier, camera) for earlier in observation.history)
        for name in (*(name for name, spec in ARRAYS if spec.is_image), "beyond_range"):
            if given.get(name) is not None:
                changes[name] = self._part(given[name])
        if (labels := given.get("instances")) is not None:
            changes["instances"] = InstanceImage(self._part(labels.ids), labels.categories)
        return with_changes(observation, **changes)

    def _part(self, image: Array) -> Array:
        """Return the central part of an image (H, W, ...), which may have another resolution than the camera."""
        height, width = image.shape[:2]
        rows = _side(height, self._camera.height, self._crop.height)
        columns = _side(width, self._camera.width, self._crop.width)
        top, left = (height - rows) // 2, (width - columns) // 2
        part = np.array(image[top : top + rows, left : left + columns], order="C")
        part.flags.writeable = False
        return part  # type: ignore[return-value]


def _side(pixels: int, whole: int, part: int) -> int:
    """Return the pixels to keep of a side, if `part` of `whole` are kept; as many are cut on both ends."""
    return pixels - 2 * round((whole - part) / 2 * pixels / whole)


def _shifted(decision: Decision, left: float, top: float) -> Decision:
    """Return a decision about the cropped image as one about the robot's image."""

    def moved(part: Any) -> Any:
        return Pixel(part.u + left, part.v + top) if isinstance(part, Pixel) else part

    shown = decision.diagnostics
    if shown.boxes:
        boxes = tuple(
            Box(box.left + left, box.top + top, box.right + left, box.bottom + top, box.label, box.score)
            for box in shown.boxes
        )
        decision = replace(decision, diagnostics=replace(shown, boxes=boxes))
    movement: Movement | None = moved(decision.movement)
    parts: tuple[Action | Movement, ...] = tuple(map(moved, decision.parts))
    return replace(decision, movement=movement, parts=parts)
