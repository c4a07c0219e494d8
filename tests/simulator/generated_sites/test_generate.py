"""Generated flats: valid, varied, always the same for a seed, solvable, and never the embedded apartment."""

import itertools
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from shapely.geometry import Point
from typer.testing import CliRunner

from tests.models.looks import look
from vsnbench.cli.sites import app
from vsnbench.interop.site_file import write_site
from vsnbench.models.baselines.oracle import Oracle
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.robots.profiles import load_profile
from vsnbench.simulator.dynamics.physics import Physics
from vsnbench.simulator.generated_sites.generate import ROBOT_RADIUS_M, SEEDS, generate_site
from vsnbench.simulator.scene import build_scene
from vsnbench.site_checks.check import check_site
from vsnbench.sites.categories import GOAL_CATEGORIES
from vsnbench.sites.site import Site, load_site
from vsnbench.values.movement import Action
from vsnbench.values.pose import Pose

SAMPLE = [*range(5), *range(1_000, 1_005), *range(10_000, 10_005)]
"""Five seeds of every split."""
SAMPLES = [SAMPLE[:5], pytest.param(SAMPLE, marks=pytest.mark.long)]


@cache
def generated(seed: int) -> Site:
    return generate_site(seed)


@pytest.mark.parametrize("seed", SAMPLE)
def test_every_flat_passes_sites_check_and_has_what_the_protocol_asks_for(seed: int) -> None:
    site = generated(seed)
    assert check_site(site, ROBOT_RADIUS_M) == []
    assert 50 <= site.area_m2 <= 100
    assert set(GOAL_CATEGORIES) <= site.categories
    assert len(site.starts) >= 15
    for room in site.rooms:
        assert any(room.shape.contains(Point(start.position)) for start in site.starts), room.name


def test_nothing_hangs_over_a_doorway() -> None:
    hanging = [(site, thing) for site in map(generated, SAMPLE) for thing in site.objects if thing.elevation_m > 1.2]
    assert len(hanging) > 15
    for site, thing in hanging:
        assert all(thing.shape.distance(door.centre_line) > 0.15 for door in site.doors), (site.name, thing.id)


@pytest.mark.parametrize("seeds", SAMPLES, ids=len)
def test_no_two_seeds_give_the_same_flat(seeds: list[int]) -> None:
    assert len({generated(seed).sha256 for seed in seeds}) == len(seeds)
    assert len({plan_of(generated(seed)) for seed in seeds}) == len(seeds)


def test_flats_differ_in_rooms_instances_models_and_colours() -> None:
    sites = [generated(seed) for seed in SAMPLE]
    assert len({tuple(sorted(room.name for room in site.rooms)) for site in sites}) >= 4
    for goal in ("chair", "table", "monitor", "plant"):
        assert len({len(site.instances(goal)) for site in sites}) >= 2, goal
    models = {thing.model for site in sites for thing in site.instances("chair")}
    assert models == {"dining_chair", "office_chair", "armchair"}
    assert len({thing.color for site in sites for thing in site.instances("sofa")}) >= 13


def test_a_seed_always_gives_the_same_flat() -> None:
    assert generate_site(3).sha256 == generated(3).sha256


@dataclass(frozen=True)
class Plan:
    """Rooms and furniture to 5 cm, whatever names, colours and starts are."""

    rooms: frozenset[tuple[float, ...]]
    furniture: frozenset[tuple[object, ...]]


def plan_of(site: Site) -> Plan:
    def near(value: float) -> int:
        return round(value / 0.05)

    return Plan(
        frozenset(tuple(near(edge) for edge in room.shape.bounds) for room in site.rooms),
        frozenset((thing.category, *map(near, thing.shape.bounds)) for thing in site.objects),
    )


@pytest.mark.parametrize("seeds", SAMPLES, ids=len)
def test_no_generated_site_has_the_apartments_plan(seeds: list[int]) -> None:
    apartment = load_site("apartment")
    own = plan_of(apartment)
    starts = {start.position for start in apartment.starts}
    for seed in seeds:
        site = generated(seed)
        plan = plan_of(site)
        assert site.sha256 != apartment.sha256
        assert plan.rooms != own.rooms
        assert len(plan.furniture & own.furniture) <= 1
        assert len(starts & {start.position for start in site.starts}) <= 1


def test_a_seed_belongs_to_one_split_at_most() -> None:
    for one, other in itertools.combinations(SEEDS.values(), 2):
        assert one.stop <= other.start or other.stop <= one.start


@pytest.mark.parametrize("seed", [2, 1_001, 10_000])
def test_the_oracle_reaches_every_goal(seed: int) -> None:
    site = generated(seed)
    oracle = Oracle()
    for goal, start in zip(GOAL_CATEGORIES, site.starts, strict=False):
        end, last = walk(oracle, site, goal, start.pose)
        assert last is Action.STOP
        assert min(thing.shape.distance(Point(end.position)) for thing in site.instances(goal)) < 1.0, goal


def walk(oracle: Oracle, site: Site, goal: str, start: Pose) -> tuple[Pose, Action]:
    """Drive the oracle with exact odometry; return where it ended and with which action."""
    oracle.survey(site, start, load_profile("turtlebot2").base, ProtocolParameters())
    oracle.reset(goal, 0)
    pose, action = Pose(0, 0), Action.TURN_LEFT
    for _ in range(150):
        action = oracle.act(look(pose)).action
        if action is Action.STOP:
            break
        turn = {Action.TURN_LEFT: math.radians(30), Action.TURN_RIGHT: -math.radians(30)}.get(action, 0.0)
        pose = pose.compose(Pose(0.25 if action is Action.MOVE_FORWARD else 0.0, 0.0, turn))
    return start.compose(pose), action


def test_the_simulated_robot_touches_nothing_at_any_start() -> None:
    site = generated(1)
    physics = Physics(build_scene(site), load_profile("turtlebot2").base)
    for start in site.starts:
        physics.place(start.pose)
        assert physics.touch() is None, start.number


def test_a_written_flat_is_read_back_to_the_same_content(tmp_path: Path) -> None:
    path = tmp_path / "flat.yaml"
    write_site(generated(2), path)
    assert load_site(path).sha256 == generated(2).sha256
    assert [file.name for file in tmp_path.iterdir()] == ["flat.yaml"]


def test_the_command_writes_a_file_that_sites_check_accepts(tmp_path: Path) -> None:
    path = tmp_path / "flat.yaml"
    made = CliRunner().invoke(app, ["generate", "--seed", "1", "--output", str(path)])
    assert (made.exit_code, made.stdout.strip()) == (0, str(path))
    checked = CliRunner().invoke(app, ["check", str(path)])
    assert checked.exit_code == 0
    assert "0 errors, 0 warnings" in checked.stdout


def test_a_site_that_fails_the_check_is_never_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    from vsnbench.errors import SiteError
    from vsnbench.simulator.generated_sites import generate

    bad = generated(2).model_copy(update={"objects": []})
    monkeypatch.setattr(generate, "_draw", lambda seed, rng: bad)
    with pytest.raises(SiteError, match="seed 2 gave no valid site"):
        generate_site(2)
