"""A profile is corrected by the images of a camera over ROS 1, or stays unchanged."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.robots import calibrating
from tests.ros.ros1.network import HERE, RosNetwork, live_network
from vsnbench.errors import RobotError
from vsnbench.robots.calibration import write_corrections
from vsnbench.robots.profiles import ANNOTATED_EXAMPLE, embedded_profiles, load_profile


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RosNetwork]:
    with live_network(tmp_path_factory.mktemp("ros")) as network:
        network.start(HERE / "nodes" / "floor_camera.py")
        network.wait_for_publisher("/camera/depth/image_raw")
        yield network


@pytest.mark.ros
@pytest.mark.parametrize("topics", [{}, calibrating.COMPRESSED], ids=["raw", "compressed"])
def test_a_profile_is_corrected_over_ros1(network: RosNetwork, tmp_path: Path, topics: dict[str, str]) -> None:
    calibrating.corrects_the_profile(network.environment, tmp_path, "ros1", **topics)


@pytest.mark.ros
@pytest.mark.parametrize("what", calibrating.REFUSED)
@pytest.mark.long
def test_a_failed_measurement_over_ros1_is_an_error_of_one_line(network: RosNetwork, tmp_path: Path, what: str) -> None:
    calibrating.is_refused_in_one_line(network.environment, tmp_path, "ros1", what)


@pytest.mark.ros
@pytest.mark.parametrize(
    "check",
    [
        calibrating.finds_the_camera_askew,
        calibrating.names_a_contradiction,
        calibrating.crops_the_view_from_a_fisheye_lens,
        calibrating.survives_an_unnamed_compressed_topic,
    ],
)
def test_the_doctor_looks_at_the_camera_over_ros1(network: RosNetwork, tmp_path: Path, check) -> None:
    check(network.environment, tmp_path, "ros1")


@pytest.mark.parametrize("name", [*embedded_profiles(), "annotated"])
def test_corrections_keep_comments_and_everything_else(tmp_path: Path, name: str) -> None:
    source, target = embedded_profiles().get(name, ANNOTATED_EXAMPLE), tmp_path / "new.yaml"
    write_corrections(source, target, {"mount_height_m": 0.432, "roll_deg": 1.5})
    old, new = load_profile(source), load_profile(target)
    assert new.camera == old.camera.model_copy(update={"mount_height_m": 0.432, "roll_deg": 1.5})
    assert new.model_copy(update={"camera": old.camera}).content() == old.content()
    comments = [line.partition("#")[2] for line in source.read_text().splitlines() if "#" in line]
    assert all(comment in target.read_text() for comment in comments)


def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(RobotError):
        write_corrections(ANNOTATED_EXAMPLE, tmp_path / "file" / "new.yaml", {})
