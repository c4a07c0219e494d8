"""A measured placement: green only if its region is within tolerance, and corrections."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.values.placement import (
    Direction,
    MeasuredPlacement,
    PlacementMethod,
    PlacementTolerance,
    PoseCovariance,
)
from vsnbench.values.pose import Pose

MARK = Pose(2.0, 1.0, math.radians(90))


def placed(
    ahead_m: float, left_m: float, turn_deg: float, std_m: float = 0.01, std_deg: float = 0.2
) -> MeasuredPlacement:
    variance = PoseCovariance.of(np.diag([std_m**2, std_m**2, math.radians(std_deg) ** 2]))
    pose = MARK.compose(Pose(ahead_m, left_m, math.radians(turn_deg)))
    return MeasuredPlacement(4, MARK, pose, variance, PlacementTolerance(), PlacementMethod.LOOK, 1)


def test_the_whole_region_must_be_within_the_tolerance() -> None:
    assert placed(0.03, -0.02, 1.0).within_tolerance
    assert not placed(0.12, 0.0, 0.0).within_tolerance
    assert not placed(0.0, 0.0, 3.2).within_tolerance
    assert not placed(0.03, 0.0, 0.0, std_m=0.03).within_tolerance, "a region of 8 cm around an offset of 3 cm"
    assert not placed(0.0, 0.0, 0.0, std_deg=1.2).within_tolerance


def test_an_undetermined_placement_is_not_in_place_and_has_no_arrows() -> None:
    right = placed(0.0, 0.0, 0.0)
    for doubt in (replace(right, undetermined=("left-right",)), replace(right, fits=False)):
        assert not doubt.within_tolerance
        assert doubt.arrows == ()
        assert doubt.advice
    assert replace(right, undetermined=("left-right",)).headline == "not determined: left-right"


def test_arrows_are_relative_to_the_robot() -> None:
    arrows = placed(0.20, -0.04, 10.0).arrows
    assert [arrow.direction for arrow in arrows] == [Direction.TURN_RIGHT, Direction.BACKWARD, Direction.LEFT]
    assert arrows[0].text == "turn right 10°"
    moved = MARK.compose(Pose(0.20, -0.04, math.radians(10.0)))
    ways = {arrow.direction: arrow.amount for arrow in arrows}
    mended = moved.compose(Pose(-ways[Direction.BACKWARD], ways[Direction.LEFT]))
    assert mended.distance_to(MARK) == pytest.approx(0.0, abs=1e-9)


def test_a_covariance_is_turned_into_the_mark_s_frame() -> None:
    along_x = PoseCovariance.of(np.diag([0.04, 0.0001, 0.01]))
    got = replace(placed(0.0, 0.0, 0.0), covariance=along_x)
    assert got.offset_covariance.yy == pytest.approx(0.04), "the mark faces along y: x lies to its right"
    assert got.region_m == pytest.approx(2.490 * 0.2, abs=0.001)
    assert PoseCovariance(*along_x.values) == along_x


def test_a_covariance_with_nan_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        PoseCovariance(math.nan, 0, 0, 1, 0, 1)


def test_only_another_tolerance_is_serialized() -> None:
    assert "placement" not in ProtocolParameters().model_dump(mode="json")
    strict = ProtocolParameters(placement=PlacementTolerance(distance_m=0.05))
    assert ProtocolParameters.from_record(strict.model_dump(mode="json")) == strict


def test_a_placement_is_plain_json() -> None:
    told = placed(0.2, 0.0, 0.0).as_json()
    assert told["offset"]["ahead_m"] == pytest.approx(0.2)
    assert told["within_tolerance"] is False
    assert told["arrows"] == [{"direction": "backward", "amount": pytest.approx(0.2), "words": "20 cm backward"}]


def test_the_region_has_95_percent_coverage_at_any_correlation() -> None:
    spread = np.array([[0.03, 0.0, 0.0], [0.01, 0.01, 0.0], [0.02, -0.01, 0.005]])
    matrix = spread @ spread.T
    covariance = PoseCovariance.of(matrix)
    away = np.random.default_rng(5).multivariate_normal(np.zeros(3), matrix, 4000)
    held = np.mean([covariance.holds(Pose(*map(float, one))) for one in away])
    assert 0.945 <= held <= 0.975


def test_a_turn_is_advised_only_if_one_look_is_not_enough() -> None:
    assert not placed(0.0, 0.0, 0.0).wants_turn, "its position is correct"
    assert not placed(0.3, 0.0, 0.0).wants_turn, "it must be moved in any case"
    unsure = replace(placed(0.02, 0.0, 0.0), covariance=PoseCovariance(0.05**2, 0, 0, 0.05**2, 0, 1e-4))
    assert unsure.wants_turn
    assert "turn on the spot" in unsure.advice
    assert not replace(unsure, method=PlacementMethod.TURN).wants_turn
    assert "move it nearer" in replace(unsure, method=PlacementMethod.TURN, pose=unsure.mark).advice
