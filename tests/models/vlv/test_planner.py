"""The planner: paths, and the actions along them."""

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsnbench.models.vlv.planner import FloatGrid, Planner, Terrain, path_of, value_at
from vsnbench.models.vlv.settings import VLVSettings
from vsnbench.sensing.occupancy_map import OccupancyMap
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

SETTINGS = VLVSettings()


def map_with(obstacles: list[tuple[float, float]], robot: Pose) -> OccupancyMap:
    grid = OccupancyMap(SETTINGS.mapping)
    for x_m, y_m in obstacles:
        grid.mark_obstacle(x_m, y_m, robot)
    return grid


def wall(x_m: float, low_m: float, high_m: float) -> list[tuple[float, float]]:
    return [(x_m, float(y)) for y in np.arange(low_m, high_m, 0.05)]


def route_to(grid: OccupancyMap, pose: Pose, target: tuple[float, float]) -> tuple[Terrain, FloatGrid] | None:
    planner = Planner(SETTINGS)
    targets = np.zeros(grid.shape, np.bool_)
    cell = grid.cell_at(*target)
    targets[cell.row, cell.column] = True
    terrain = planner.terrain(grid, pose, SETTINGS.clearance_m)
    field_m = planner.route(terrain, targets, pose)
    return None if field_m is None else (terrain, field_m)


obstacles = st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), max_size=120)
points = st.tuples(st.floats(-4, 4), st.floats(-4, 4))


@settings(deadline=None, max_examples=80)
@given(obstacles, points, points)
def test_a_path_avoids_obstacles_and_is_never_shorter_than_the_straight_line(
    blocks: list[tuple[float, float]], start: tuple[float, float], end: tuple[float, float]
) -> None:
    pose = Pose(*start)
    grid = map_with(blocks, pose)
    route = route_to(grid, pose, end)
    if route is None:
        return
    path = path_of(*route, pose)
    assert path[0] == start
    assert math.dist(path[-1], end) <= grid.resolution_m
    length_m = 0.0
    for here, there in itertools.pairwise(path):
        length_m += math.dist(here, there)
        for share in np.linspace(0, 1, 5):
            x_m, y_m = here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])
            cell = grid.cell_at(x_m, y_m)
            assert not grid.occupied[cell.row, cell.column]
    assert length_m >= math.dist(path[0], path[-1]) - 1e-9
    assert value_at(route[1], grid, pose.position) >= math.dist(start, end) - 1.5 * grid.resolution_m


@settings(deadline=None, max_examples=60)
@given(obstacles, points)
def test_ways_are_never_shorter_than_the_straight_line(
    blocks: list[tuple[float, float]], start: tuple[float, float]
) -> None:
    pose = Pose(*start)
    grid = map_with(blocks, pose)
    planner = Planner(SETTINGS)
    lengths_m = planner.lengths_from(planner.terrain(grid, pose, 0.0), pose)
    here = grid.cell_at(*start)
    rows, columns = np.indices(grid.shape)
    straight = np.hypot(rows - here.row, columns - here.column) * grid.resolution_m
    assert (lengths_m >= straight - 1e-6).all()


def test_the_field_is_that_of_an_independent_fast_marching() -> None:
    import skfmm

    pose = Pose(-1.5, 0.0)
    grid = map_with(wall(0.0, -2.0, 1.0), pose)
    planner = Planner(SETTINGS)
    terrain = planner.terrain(grid, pose, 0.0)
    lengths_m = planner.lengths_from(terrain, pose)
    level = np.ones(grid.shape)
    here = grid.cell_at(*pose.position)
    level[here.row, here.column] = -1.0
    theirs = skfmm.distance(np.ma.MaskedArray(level, mask=~terrain.open_cells), dx=grid.resolution_m, order=1)
    both = terrain.open_cells & np.isfinite(lengths_m)
    assert np.abs(np.ma.filled(theirs, np.nan)[both] - lengths_m[both]).max() < 1.5 * grid.resolution_m


def drive(grid: OccupancyMap, pose: Pose, target: tuple[float, float], most: int = 60) -> list[Pose]:
    """Execute the planner's actions exactly until the target is reached."""
    planner = Planner(SETTINGS)
    way = [pose]
    for _ in range(most):
        if math.dist(pose.position, target) < 0.25:
            return way
        route = route_to(grid, pose, target)
        assert route is not None
        action = planner.next_action(*route, pose)
        assert action is not None
        turn = {Action.TURN_LEFT: math.pi / 6, Action.TURN_RIGHT: -math.pi / 6}.get(action, 0.0)
        pose = pose.compose(Pose(0.25 if action is Action.MOVE_FORWARD else 0.0, 0.0, turn))
        way.append(pose)
    raise AssertionError(f"not there after {most} actions: {pose}")


def test_the_actions_lead_around_a_wall_with_clearance_on_all_the_way() -> None:
    grid = map_with(wall(0.0, -2.0, 1.0), Pose(-1.5, 0.0))
    way = drive(grid, Pose(-1.5, 0.0, 0.3), (1.5, 0.0))
    blocks = np.array(wall(0.0, -2.0, 1.0))
    nearest = min(float(np.hypot(*(blocks - each.position).T).min()) for each in way)
    assert nearest >= SETTINGS.robot_radius_m


def test_a_door_of_seventy_centimetres_is_passed_at_any_angle_of_the_wall() -> None:
    for angle in np.radians([0, 7, 15, 22]):
        blocks = [
            (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle))
            for y in (*np.arange(-2.5, -0.35, 0.03), *np.arange(0.375, 2.5, 0.03))
            for x in (0.0, 0.05)
        ]
        start = Pose(-1.2 * math.cos(angle), -1.2 * math.sin(angle))
        target = (1.2 * math.cos(angle), 1.2 * math.sin(angle))
        assert len(drive(map_with(blocks, start), start, target)) < 40


def test_a_forward_move_known_to_be_refused_is_not_asked_for_again() -> None:
    grid = OccupancyMap(SETTINGS.mapping)
    route = route_to(grid, Pose(0, 0), (2.0, 0.0))
    assert route is not None
    assert Planner(SETTINGS).next_action(*route, Pose(0, 0)) is Action.MOVE_FORWARD
    refused = Planner(SETTINGS).next_action(*route, Pose(0, 0), forward_refused=True)
    assert refused in (Action.TURN_LEFT, Action.TURN_RIGHT)


def test_no_forward_move_is_planned_that_the_depth_guard_would_refuse() -> None:
    pose = Pose(0, 0)
    grid = map_with([(0.5, y) for y in (-0.1, 0.0, 0.1)], pose)
    route = route_to(grid, pose, (2.0, 0.0))
    assert route is not None
    assert Planner(SETTINGS).next_action(*route, pose) is not Action.MOVE_FORWARD


def test_a_walled_in_target_has_no_route() -> None:
    ring = [(2 + 0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 200)]
    assert route_to(map_with(ring, Pose(0, 0)), Pose(0, 0), (2.0, 0.0)) is None


@pytest.mark.parametrize("beside_m", [0.18, 0.2, 0.22])
def test_a_robot_too_near_to_something_finds_its_way_out(beside_m: float) -> None:
    pose = Pose(0.0, beside_m, math.pi / 2)
    blocks: npt.NDArray[np.float64] = np.array([(x, 0.0) for x in np.arange(-1, 1, 0.05)])
    grid = map_with([(float(x), float(y)) for x, y in blocks], pose)
    route = route_to(grid, pose, (0.0, 2.0))
    assert route is not None
    assert Planner(SETTINGS).next_action(*route, pose) is Action.MOVE_FORWARD
