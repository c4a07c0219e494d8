"""A model's training camera compared with robots' cameras: differences and crop."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from vsnbench.errors import ModelError
from vsnbench.models.contract import ModelCard
from vsnbench.models.description import describe_model
from vsnbench.models.pirlnav.policy import DEMONSTRATION_CAMERA
from vsnbench.models.remote.card import card_of
from vsnbench.robots.profiles import embedded_profiles, load_profile
from vsnbench.values.camera import Camera
from vsnbench.values.model.trained_camera import TrainedCamera, cropped

TRAINED = {
    "pirlnav": {"mount_height_m": 0.88, "tilt_deg": 0.0, "horizontal_fov_deg": 79.0, "size": (640, 480)},
    "vlv": {"mount_height_m": 1.25, "tilt_deg": 0.0, "horizontal_fov_deg": 90.0, "size": (224, 224)},
}
"""Published cameras, typed in from the models' repositories."""


def seen_by(fov_deg: float, width: int, height: int) -> float:
    """Vertical field of view from the directions of the outermost rays."""
    per_pixel = 2 * math.tan(math.radians(fov_deg) / 2) / width
    return 2 * math.degrees(math.atan2(per_pixel * height / 2, 1))


def stated_camera(model: str) -> TrainedCamera:
    card = describe_model(model).card
    assert card is not None
    assert card.camera is not None
    return card.camera


@pytest.mark.parametrize("model", TRAINED)
@pytest.mark.parametrize("robot", embedded_profiles())
def test_differences_between_published_models_and_embedded_robots_are_correct(model: str, robot: str) -> None:
    trained, camera = TRAINED[model], load_profile(robot).camera
    expected = {
        "mount_height_m": camera.mount_height_m - trained["mount_height_m"],
        "tilt_deg": camera.tilt_deg - trained["tilt_deg"],
        "horizontal_fov_deg": camera.horizontal_fov_deg - trained["horizontal_fov_deg"],
        "vertical_fov_deg": seen_by(camera.horizontal_fov_deg, camera.width, camera.height)
        - seen_by(trained["horizontal_fov_deg"], *trained["size"]),
    }
    found = {difference.quantity: difference for difference in stated_camera(model).differences(camera)}
    resolution = found.pop("resolution_px", None)
    assert (resolution is not None) == ((camera.width, camera.height) != trained["size"])
    assert {name: pytest.approx(gap) for name, gap in expected.items() if abs(gap) > (0.02 if "_m" in name else 1)} == {
        name: difference.actual - difference.trained for name, difference in found.items()
    }
    for name, difference in found.items():
        number = float(difference.text.split("°")[0].split(" m")[0])
        assert number == pytest.approx(abs(expected[name]), abs=0.051)
        up = expected[name] > 0
        word = {"mount_height_m": "higher" if up else "lower"}.get(name, "wider" if up else "narrower")
        assert word in difference.text


def test_a_turtlebot_with_a_tilted_camera_reads_like_the_words_of_a_colleague() -> None:
    camera = load_profile("turtlebot2").camera.model_copy(update={"tilt_deg": -5.0})
    texts = [difference.text for difference in stated_camera("pirlnav").differences(camera)]
    assert texts[:3] == ["0.28 m lower", "5° further down", "19° narrower"]


def test_a_camera_within_a_trained_range_does_not_differ() -> None:
    camera = load_profile("turtlebot2").camera
    assert DEMONSTRATION_CAMERA.differences(camera) == ()
    (higher,) = DEMONSTRATION_CAMERA.differences(camera.model_copy(update={"mount_height_m": 0.9}))
    assert (higher.trained, higher.text) == (0.75, "0.15 m higher")


def test_what_a_card_does_not_state_is_not_compared() -> None:
    camera = load_profile("lola2").camera
    assert TrainedCamera().differences(camera) == ()
    assert [found.quantity for found in TrainedCamera(mount_height_m=0.5).differences(camera)] == ["mount_height_m"]


@settings(deadline=None)
@given(
    st.integers(64, 1920), st.integers(64, 1080), st.floats(30, 150), st.floats(20, 140), st.sampled_from([4 / 3, 1, 2])
)
def test_a_crop_has_the_trained_view_to_a_pixel_and_the_same_rays(
    width: int, height: int, fov_deg: float, trained_deg: float, aspect: float
) -> None:
    camera = Camera(width=width, height=height, horizontal_fov_deg=fov_deg, mount_height_m=1)
    trained = TrainedCamera(horizontal_fov_deg=trained_deg, width=round(480 * aspect), height=480)
    try:
        crop = cropped(trained, camera)
    except ValueError:
        narrower = (
            trained_deg > fov_deg,
            seen_by(trained_deg, round(480 * aspect), 480) > seen_by(fov_deg, width, height),
        )
        assert any(narrower)
        return
    assume(min(crop.width, crop.height) > 0)
    assert crop.focal_px == pytest.approx(camera.focal_px)
    assert (width - crop.width) % 2 == (height - crop.height) % 2 == 0
    wanted_px = 2 * camera.focal_px * math.tan(math.radians(trained_deg) / 2)
    assert abs(crop.width - wanted_px) <= max(1, 0.01 * width) + 1e-6
    assert abs(crop.height - wanted_px * 480 / round(480 * aspect)) <= max(1, 0.01 * height) + 1e-6


def test_a_crop_to_a_trained_range_ends_at_its_border() -> None:
    wide = load_profile("turtlebot2").camera.model_copy(update={"horizontal_fov_deg": 80.0})
    assert cropped(DEMONSTRATION_CAMERA, wide).horizontal_fov_deg == pytest.approx(68, abs=0.2)
    turtlebot = load_profile("turtlebot2").camera
    assert cropped(DEMONSTRATION_CAMERA, turtlebot) == turtlebot


def test_the_camera_is_not_part_of_the_identity_and_travels_with_a_served_card() -> None:
    camera = {"mount_height_m": 0.88, "horizontal_fov_deg": [55, 68], "width": 640, "height": 480}
    card = card_of({"card": {"name": "m", "goals": None, "camera": camera}}, {})
    assert card.camera == TrainedCamera(mount_height_m=0.88, horizontal_fov_deg=(55, 68), width=640, height=480)
    assert card.difference(ModelCard("m")) == ""
    assert card == ModelCard("m")


@pytest.mark.parametrize(
    "camera",
    [
        {"mount_height_m": -1},
        {"mount_height_m": float("nan")},
        {"horizontal_fov_deg": [68, 55]},
        {"horizontal_fov_deg": "wide"},
        {"width": 640},
        {"colour": "red"},
        [1, 2],
    ],
)
def test_an_invalid_camera_on_a_served_card_is_one_line(camera: object) -> None:
    with pytest.raises(ModelError) as refused:
        card_of({"card": {"name": "m", "goals": None, "camera": camera}}, {})
    assert "\n" not in str(refused.value)
    if isinstance(camera, dict):
        with pytest.raises(ValidationError):
            TrainedCamera.model_validate(camera)
