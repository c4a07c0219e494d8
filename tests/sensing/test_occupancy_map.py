"""The occupancy map: permitted and forbidden changes by a depth image."""

import math

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.sensing.occupancy_map import FREE, OCCUPIED, UNKNOWN, OccupancyMap
from vsnbench.values.camera import Camera
from vsnbench.values.pose import Pose

CAMERA = Camera(width=64, height=48, horizontal_fov_deg=60, mount_height_m=0.6, depth_min_m=0.4, depth_max_m=8)


def _image(seed: int, near_m: float, spread_m: float, lost: float) -> npt.NDArray[np.float32]:
    random = np.random.default_rng(seed)
    depth = (near_m + spread_m * random.random((48, 64))).astype(np.float32)
    depth[random.random((48, 64)) < lost] = np.nan
    return depth


poses = st.builds(Pose, st.floats(-30, 30), st.floats(-30, 30), st.floats(-math.pi, math.pi))
depth_images = st.builds(
    _image,
    st.integers(0, 2**32 - 1),
    st.floats(0.05, 3),
    st.floats(0, 6),
    st.floats(0, 1),
)


def wall_ahead(distance_m: float) -> npt.NDArray[np.float32]:
    """Return the image of a wall on a bare floor."""
    down = (np.arange(48, dtype=np.float32) - 23.5) / np.float32(CAMERA.focal_px)
    with np.errstate(divide="ignore"):
        floor = np.where(down > 0, np.float32(CAMERA.mount_height_m) / down, np.inf)
    return np.repeat(np.minimum(floor, distance_m).astype(np.float32)[:, None], 64, axis=1)


def said_at(grid: OccupancyMap, x_m: float, y_m: float) -> int:
    cell = grid.cell_at(x_m, y_m)
    return int(grid.cells()[cell.row, cell.column]) if grid.holds(cell) else UNKNOWN


def test_a_wall_is_occupied_with_free_cells_before_and_unknown_behind() -> None:
    grid = OccupancyMap()
    grid.observe(wall_ahead(2.0), CAMERA, Pose(0, 0))
    assert said_at(grid, 2.01, 0.0) == OCCUPIED
    assert said_at(grid, 1.0, 0.0) == FREE
    assert said_at(grid, 3.0, 0.0) == UNKNOWN
    assert said_at(grid, 0.0, 2.0) == UNKNOWN


def test_the_heading_rotates_the_image_into_the_map() -> None:
    grid = OccupancyMap()
    grid.observe(wall_ahead(2.0), CAMERA, Pose(1.0, 0.5, math.pi / 2))
    assert said_at(grid, 1.0, 2.51) == OCCUPIED
    assert said_at(grid, 1.0, 1.5) == FREE


def test_two_points_make_an_obstacle_and_one_does_not() -> None:
    for points, said in ((1, False), (2, True)):
        depth = np.full((48, 64), np.nan, np.float32)
        depth[24, 32 : 32 + points] = 1.5
        grid = OccupancyMap()
        grid.observe(depth, CAMERA, Pose(0, 0))
        assert grid.occupied.any() == said


def test_cells_seen_through_later_are_cleared() -> None:
    grid = OccupancyMap()
    grid.observe(wall_ahead(2.0), CAMERA, Pose(0, 0))
    for _ in range(3):
        grid.observe(wall_ahead(4.0), CAMERA, Pose(0, 0))
    assert said_at(grid, 2.01, 0.0) == FREE


def test_the_grid_grows_where_the_robot_leaves_it_and_keeps_its_cells() -> None:
    grid = OccupancyMap()
    grid.observe(wall_ahead(2.0), CAMERA, Pose(0, 0))
    before = grid.shape
    grid.observe(wall_ahead(2.0), CAMERA, Pose(-14, 9))
    assert grid.shape[0] > before[0]
    assert grid.shape[1] > before[1]
    assert said_at(grid, 2.01, 0.0) == OCCUPIED
    assert said_at(grid, -11.99, 9.0) == OCCUPIED


def test_a_contact_stays_marked_even_if_the_cell_looks_free() -> None:
    grid = OccupancyMap()
    grid.mark_obstacle(1.0, 0.0, Pose(0.5, 0.0))
    for _ in range(10):
        grid.observe(wall_ahead(4.0), CAMERA, Pose(0, 0))
    assert said_at(grid, 1.0, 0.0) == OCCUPIED


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(depth_images, poses), min_size=1, max_size=3))
def test_the_robot_s_own_cell_is_never_an_obstacle(looks: list[tuple[npt.NDArray[np.float32], Pose]]) -> None:
    grid = OccupancyMap()
    for depth, pose in looks:
        grid.observe(depth, CAMERA, pose)
        assert said_at(grid, *pose.position) != OCCUPIED


@settings(deadline=None, max_examples=40)
@given(depth_images, poses, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_a_contact_never_marks_the_robot_s_own_cell(
    depth: npt.NDArray[np.float32], pose: Pose, ahead_m: float, aside_m: float
) -> None:
    grid = OccupancyMap()
    grid.observe(depth, CAMERA, pose)
    grid.mark_obstacle(*pose.compose(Pose(ahead_m, aside_m)).position, pose)
    assert said_at(grid, *pose.position) != OCCUPIED


@settings(deadline=None, max_examples=40)
@given(depth_images, poses, poses)
def test_an_image_without_valid_depth_changes_nothing(
    depth: npt.NDArray[np.float32], pose: Pose, elsewhere: Pose
) -> None:
    grid = OccupancyMap()
    grid.observe(depth, CAMERA, pose)
    before = grid.grid_map()
    grid.observe(np.full((48, 64), np.nan, np.float32), CAMERA, elsewhere)
    after = grid.grid_map()
    assert np.array_equal(before.cells, after.cells)
    assert math.isclose(before.origin_x_m, after.origin_x_m, abs_tol=1e-9)


@settings(deadline=None, max_examples=40)
@given(depth_images, poses, st.integers(0, 2**32 - 1))
def test_losing_pixels_never_adds_an_obstacle(depth: npt.NDArray[np.float32], pose: Pose, seed: int) -> None:
    whole, holed = OccupancyMap(), OccupancyMap()
    whole.observe(depth, CAMERA, pose)
    fewer = np.where(np.random.default_rng(seed).random(depth.shape) < 0.5, depth, np.float32(np.nan))
    holed.observe(fewer, CAMERA, pose)
    assert _obstacles(holed) <= _obstacles(whole)


def _obstacles(grid: OccupancyMap) -> set[tuple[int, int]]:
    """Return the occupied cells relative to the frame's origin, because maps with farther views grow more."""
    rows, columns = np.nonzero(grid.occupied)
    below, left = (round(origin_m / grid.resolution_m) for origin_m in (grid.origin_y_m, grid.origin_x_m))
    return {(int(row), int(column)) for row, column in zip(rows + below, columns + left, strict=True)}
