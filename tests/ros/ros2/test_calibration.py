"""A profile is corrected by the images of a camera over ROS 2, or stays unchanged."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.processes import wait_until
from tests.robots import calibrating
from tests.ros.ros2.graph import HERE, Graph2, live_graph

pytestmark = pytest.mark.ros2


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph2]:
    with live_graph(tmp_path_factory.mktemp("ros2"), shares_memory=True) as graph:
        camera = graph.start(HERE / "nodes" / "floor_camera.py")
        wait_until(lambda: "up" in camera.output, "the camera is up", 60)
        yield graph


@pytest.mark.parametrize(
    "topics", [{}, pytest.param(calibrating.COMPRESSED, marks=pytest.mark.long)], ids=["raw", "compressed"]
)
def test_a_profile_is_corrected_over_ros2(graph: Graph2, tmp_path: Path, topics: dict[str, str]) -> None:
    calibrating.corrects_the_profile(graph.environment, tmp_path, "ros2", **topics)


@pytest.mark.long
@pytest.mark.parametrize("what", calibrating.REFUSED)
def test_a_failed_measurement_over_ros2_is_an_error_of_one_line(graph: Graph2, tmp_path: Path, what: str) -> None:
    calibrating.is_refused_in_one_line(graph.environment, tmp_path, "ros2", what)


@pytest.mark.parametrize(
    "check",
    [
        calibrating.finds_the_camera_askew,
        pytest.param(calibrating.names_a_contradiction, marks=pytest.mark.long),
        pytest.param(calibrating.crops_the_view_from_a_fisheye_lens, marks=pytest.mark.long),
        pytest.param(calibrating.survives_an_unnamed_compressed_topic, marks=pytest.mark.long),
    ],
)
def test_the_doctor_looks_at_the_camera_over_ros2(graph: Graph2, tmp_path: Path, check) -> None:
    check(graph.environment, tmp_path, "ros2")
