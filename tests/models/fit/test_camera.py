"""Images cropped for a model: every sensor, the camera, and pixels in its answers."""

from dataclasses import replace

import numpy as np
import pytest

from vsnbench.errors import UsageError
from vsnbench.models.contract import ModelCard, Policy
from vsnbench.models.fit.camera import CroppedPolicy, comparison_text, crop_for
from vsnbench.models.task import Task, task_of
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.values.camera import Camera
from vsnbench.values.decision import Box, Decision, Diagnostics
from vsnbench.values.model.trained_camera import TrainedCamera
from vsnbench.values.movement import Action, ActionKind, Chunk, Pixel
from vsnbench.values.observation import InstanceImage, Observation, Sensor, shown_to_policy
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=90, mount_height_m=0.6)
CARD = ModelCard(
    "narrow",
    sensors=frozenset(Sensor),
    action_kinds=frozenset(ActionKind),
    camera=TrainedCamera(horizontal_fov_deg=53.13, width=32, height=24),
)
"""Trained with half the width of CAMERA: tan(53.13° / 2) is a half."""


class Narrow(Policy):
    """Keeps what it receives, and answers with the given decision."""

    def __init__(self, card: ModelCard = CARD) -> None:
        self.card = card
        self.seen: list[Observation] = []
        self.task: Task | None = None
        self.answer = Decision(Action.STOP)

    def reset(self, goal: str, seed: int) -> None:
        """Start an episode."""

    def begin(self, task: Task) -> None:
        """Keep the task."""
        self.task = task

    def act(self, observation: Observation) -> Decision:
        """Keep the observation."""
        self.seen.append(observation)
        return self.answer


def observation(depth_scale: int = 1) -> Observation:
    rows, columns = np.mgrid[0:48, 0:64]
    rgb = np.stack([rows, columns, rows + columns], axis=-1).astype(np.uint8)
    depth_m = (columns + 100 * rows).astype(np.float32)[::depth_scale, ::depth_scale]
    labels = InstanceImage((columns + 100 * rows).astype(np.int32), {1: "chair"})
    return Observation(rgb, depth_m, Pose(1, 2, 0.5), 3.0, CAMERA, labels, beyond_range=depth_m > 1000)


@pytest.fixture
def model() -> Narrow:
    """A model that was trained with half the width and height of CAMERA."""
    return Narrow()


@pytest.fixture
def fitted(model: Narrow) -> CroppedPolicy:
    """The model behind the crop."""
    return CroppedPolicy(model, CAMERA, crop_for(CARD, "bot", CAMERA))


def test_every_image_is_its_central_part_and_fits_its_camera(fitted: CroppedPolicy, model: Narrow) -> None:
    given = observation()
    fitted.act(shown_to_policy(given, CARD.sensors))
    (seen,) = model.seen
    part = np.s_[12:36, 16:48]
    assert given.depth_m is not None
    assert given.instances is not None
    assert given.beyond_range is not None
    assert seen.instances is not None
    assert np.array_equal(seen.rgb, given.rgb[part])
    assert np.array_equal(seen.depth_m, given.depth_m[part])
    assert np.array_equal(seen.instances.ids, given.instances.ids[part])
    assert np.array_equal(seen.beyond_range, given.beyond_range[part])
    assert (seen.pose, seen.stamp_s) == (given.pose, given.stamp_s)
    assert (seen.camera.width, seen.camera.height) == (32, 24)
    assert seen.camera.horizontal_fov_deg == pytest.approx(53.13, abs=0.01)
    points, whole = seen.camera.points_in_base(seen.depth_m), CAMERA.points_in_base(given.depth_m)
    assert np.allclose(points, whole[part], atol=1e-3, rtol=1e-5)
    assert not seen.rgb.flags.writeable


def test_depth_of_another_resolution_is_cropped_in_proportion(fitted: CroppedPolicy, model: Narrow) -> None:
    given = observation(depth_scale=2)
    fitted.act(shown_to_policy(given, CARD.sensors))
    assert given.depth_m is not None
    assert np.array_equal(model.seen[0].depth_m, given.depth_m[6:18, 8:24])


def test_images_between_decisions_are_cropped_too(fitted: CroppedPolicy, model: Narrow) -> None:
    given = observation()
    fitted.act(shown_to_policy(replace(given, history=(given, given)), CARD.sensors))
    for earlier in model.seen[0].history:
        assert np.array_equal(earlier.rgb, given.rgb[12:36, 16:48])
        assert (earlier.camera.width, earlier.depth_m.shape) == (32, (24, 32))  # type: ignore[union-attr]


def test_a_sensor_that_is_not_on_the_card_stays_hidden(model: Narrow) -> None:
    card = replace(CARD, sensors=frozenset({Sensor.RGB}))
    model = Narrow(card)
    CroppedPolicy(model, CAMERA, crop_for(card, "bot", CAMERA)).act(shown_to_policy(observation(), card.sensors))
    assert model.seen[0].sensors == {Sensor.RGB}


def test_pixels_and_boxes_are_those_of_the_robot_s_image(fitted: CroppedPolicy, model: Narrow) -> None:
    box = Diagnostics(boxes=(Box(1, 2, 3, 4, "chair", 0.5),))
    model.answer = Decision(Pixel(5, 6), diagnostics=box)
    decision = fitted.act(shown_to_policy(observation(), CARD.sensors))
    assert decision.movement == Pixel(21, 18)
    assert decision.diagnostics.boxes == (Box(17, 14, 19, 16, "chair", 0.5),)
    model.answer = Decision(Chunk((Pixel(0, 0), Action.STOP)))
    assert fitted.act(shown_to_policy(observation(), CARD.sensors)).parts == (Pixel(16, 12), Action.STOP)


def test_the_task_has_the_cropped_camera(fitted: CroppedPolicy, model: Narrow) -> None:
    tilted = CAMERA.model_copy(update={"tilt_deg": -7.0})
    profile = load_profile("turtlebot2").model_copy(update={"camera": tilted})
    fitted.begin(task_of("chair", 0, ProtocolParameters(), profile))
    assert model.task is not None
    seen = model.task.robot.camera
    assert (seen.width, seen.height, seen.tilt_deg) == (32, 24, -7.0)
    assert seen.focal_px == pytest.approx(CAMERA.focal_px)


@pytest.mark.parametrize(
    ("camera", "code"),
    [
        (None, "no-trained-camera"),
        (TrainedCamera(mount_height_m=0.5), "no-trained-camera"),
        (TrainedCamera(horizontal_fov_deg=100), "narrower-camera"),
        (TrainedCamera(horizontal_fov_deg=60, width=24, height=48), "narrower-camera"),
    ],
)
def test_a_crop_that_is_impossible_is_refused(camera: TrainedCamera | None, code: str) -> None:
    with pytest.raises(UsageError) as refused:
        crop_for(replace(CARD, camera=camera), "bot", CAMERA)
    assert refused.value.code == code


def test_a_card_without_a_camera_is_one_line() -> None:
    text = comparison_text(ModelCard("plain"), "bot", CAMERA)
    assert "plain" in text
    assert "\n" not in text
