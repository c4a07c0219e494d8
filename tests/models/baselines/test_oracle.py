"""The oracle solves the apartment with exact motion, and tolerates refused moves."""

import math
from dataclasses import dataclass

import pytest
from shapely.geometry import LineString, Point

from tests.models.looks import look
from vsnbench.errors import ModelError
from vsnbench.models.baselines.oracle import Oracle
from vsnbench.protocol.free_space import free_space
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.geometry.walls import wall_shapes
from vsnbench.sites.site import Site, load_site
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose
from vsnbench.values.robot_profile import Base

TURTLEBOT = {"radius_m": 0.177, "height_m": 0.6, "mass_kg": 6.3, "track_m": 0.23, "wheel_radius_m": 0.035}
BASE = Base(**TURTLEBOT, max_linear_m_s=0.7, max_angular_rad_s=3.1, odometry_rate_hz=50)
RADIUS_M = BASE.radius_m


@pytest.fixture(scope="module")
def apartment() -> Site:
    return load_site("apartment")


@dataclass(frozen=True)
class Walk:
    """Result of an episode."""

    actions: list[Action]
    end: Pose
    least_clearance_m: float


def walk(
    site: Site,
    goal: str,
    start: Pose,
    refuse_moves: tuple[int, ...] = (),
    forward_m: float = 0.25,
    turn_deg: float = 30.0,
) -> Walk:
    """Drive the oracle with exact odometry; the forward moves numbered in `refuse_moves` do not move."""
    oracle, space = Oracle(), free_space(site, RADIUS_M)
    oracle.survey(site, start, BASE, ProtocolParameters())
    oracle.reset(goal, 0)
    pose, actions, moves, clearance = Pose(0, 0), [], 0, math.inf
    while len(actions) < 150:
        action = oracle.act(look(pose)).action
        actions.append(action)
        if action is Action.STOP:
            break
        if action is Action.MOVE_FORWARD:
            moves += 1
            if moves in refuse_moves:
                continue
            for share in (0.25, 0.5, 0.75, 1.0):
                on_the_way = start.compose(pose.compose(Pose(share * forward_m, 0)))
                clearance = min(clearance, space.clearance_at_m(*on_the_way.position))
            pose = pose.compose(Pose(forward_m, 0))
        else:
            turn = math.radians(turn_deg)
            pose = pose.compose(Pose(0, 0, turn if action is Action.TURN_LEFT else -turn))
    return Walk(actions, start.compose(pose), clearance)


def distance_m(site: Site, goal: str, pose: Pose) -> float:
    return min(thing.shape.distance(Point(pose.position)) for thing in site.instances(goal))


@pytest.mark.parametrize("goal", GOAL_CATEGORIES)
def test_the_oracle_reaches_every_goal_and_from_every_start_some(apartment: Site, goal: str) -> None:
    for start in apartment.starts[GOAL_CATEGORIES.index(goal) % 3 :: 3]:
        result = walk(apartment, goal, start.pose)
        where = f"{goal} from {start.number}"
        assert result.actions[-1] is Action.STOP, where
        assert len(result.actions) < 100, where
        assert distance_m(apartment, goal, result.end) < 1.0, where
        assert result.least_clearance_m > RADIUS_M, where


def test_it_stops_in_sight_of_the_goal_and_facing_it(apartment: Site) -> None:
    walls = wall_shapes(apartment)
    for start in apartment.starts[::3]:
        end = walk(apartment, "toilet", start.pose).end
        (toilet,) = apartment.instances("toilet")
        middle = toilet.shape.centroid
        assert not any(LineString([end.position, (middle.x, middle.y)]).intersects(wall) for wall in walls)
        bearing = math.atan2(middle.y - end.y_m, middle.x - end.x_m)
        assert abs(math.remainder(bearing - end.heading_rad, math.tau)) < math.radians(30)


def test_it_plans_another_way_when_moves_are_refused(apartment: Site) -> None:
    result = walk(apartment, "bed", apartment.start(9).pose, refuse_moves=(2, 3, 6))
    assert result.actions[-1] is Action.STOP
    assert distance_m(apartment, "bed", result.end) < 1.0


def test_it_does_not_repeat_a_move_that_was_refused(apartment: Site) -> None:
    oracle = Oracle()
    oracle.survey(apartment, apartment.start(14).pose, BASE, ProtocolParameters())
    oracle.reset("bed", 0)
    pose = Pose(0, 0)
    while (action := oracle.act(look(pose)).action) is not Action.MOVE_FORWARD:
        pose = pose.compose(Pose(0, 0, math.radians(30 if action is Action.TURN_LEFT else -30)))
    assert oracle.act(look(pose)).action is not Action.MOVE_FORWARD


def test_it_corrects_for_a_robot_that_moves_inexactly(apartment: Site) -> None:
    for number in (1, 8, 10, 12):
        result = walk(apartment, "toilet", apartment.start(number).pose, forward_m=0.243, turn_deg=29.2)
        assert result.actions[-1] is Action.STOP
        assert distance_m(apartment, "toilet", result.end) < 1.0
        assert result.least_clearance_m > RADIUS_M


def test_it_shows_the_way_ahead_in_the_frame_of_the_start(apartment: Site) -> None:
    oracle = Oracle()
    oracle.survey(apartment, apartment.start(5).pose, BASE, ProtocolParameters())
    oracle.reset("bed", 0)
    shown = oracle.act(look()).diagnostics
    assert shown.path[0] == pytest.approx((0.0, 0.0))
    assert shown.sub_goal == shown.path[-1]
    assert distance_m(apartment, "bed", apartment.start(5).pose.compose(Pose(*shown.path[-1]))) < 1.0


def test_a_goal_with_no_way_to_it_is_given_up_at_once(apartment: Site) -> None:
    no_plants = apartment.model_copy(
        update={"objects": [thing for thing in apartment.objects if thing.category != "plant"]}
    )
    oracle = Oracle()
    oracle.survey(no_plants, apartment.start(5).pose, BASE, ProtocolParameters())
    oracle.reset("plant", 0)
    decision = oracle.act(look())
    assert decision.action is Action.STOP
    assert "no path to a plant" in decision.diagnostics.note


def test_an_oracle_that_was_never_shown_the_site_says_so() -> None:
    oracle = Oracle()
    oracle.reset("chair", 0)
    with pytest.raises(ModelError, match="survey"):
        oracle.act(look())
