"""Movements with parameters: JSON, decisions with them, and limits."""

import math
import pickle
from dataclasses import fields
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.errors import DecisionError
from vsnbench.values.decision import Decision
from vsnbench.values.decision_check import checked_decision, checked_movement
from vsnbench.values.encoding.codec import movement_from_json
from vsnbench.values.movement import (
    MAX_PARTS,
    Action,
    ActionKind,
    Chunk,
    Move,
    Movement,
    Pixel,
    Sidestep,
    Trajectory,
    Velocity,
    Waypoint,
)

METRES = st.floats(-3, 3)
MOVEMENTS: st.SearchStrategy[Movement] = st.one_of(
    st.builds(Move, METRES, METRES),
    st.builds(Waypoint, METRES, METRES, st.none() | METRES),
    st.builds(Trajectory, st.lists(st.tuples(METRES, METRES), min_size=2, max_size=2).map(tuple)),
    st.builds(Velocity, METRES, METRES, st.floats(0.1, 2)),
    st.builds(Pixel, st.floats(0, 639), st.floats(0, 479)),
    st.builds(Sidestep, METRES),
)


@given(MOVEMENTS)
def test_json_and_check_keep_a_movement(movement: Movement) -> None:
    assert movement_from_json(movement.to_json()) == movement
    decision = checked_decision(Decision(movement))
    assert decision.movement == movement
    assert decision.action.has_parameters
    assert movement.text


def test_every_kind_of_movement_has_an_action_and_documented_parameters() -> None:
    kinds = {movement.kind for movement in get_args(Movement)}
    assert kinds == set(ActionKind) - {ActionKind.DISCRETE, ActionKind.CHUNK}
    assert {Action(kind.name) for kind in kinds} == {action for action in Action if action.has_parameters}
    for movement in get_args(Movement):
        parameters = movement.parameters()
        assert [parameter.name for parameter in parameters] == [field.name for field in fields(movement)]
        assert all(parameter.meaning for parameter in parameters)
        assert len({parameter.meaning for parameter in parameters}) == len(parameters)


def test_only_the_robots_own_actions_hold_headings() -> None:
    own = Move(0.25, holds_heading=True)
    assert movement_from_json(own.to_json()) == own
    assert checked_movement(own) == Move(0.25)
    assert movement_from_json({"kind": "move", "distance_m": 0.25, "holds_heading": 1}) == Move(0.25)


def test_a_movement_is_a_small_value_that_can_be_sent_to_another_process() -> None:
    for movement in (Waypoint(1.0, 0.5), Trajectory(((1.0, 0.0), (1.0, 1.0))), Move(0.1, holds_heading=True)):
        assert pickle.loads(pickle.dumps(movement)) == movement
        assert not hasattr(movement, "__dict__")


def test_a_chunk_is_a_decision_of_several_parts() -> None:
    decision = checked_decision(Decision(Chunk((Action.TURN_LEFT, Waypoint(1.0, 0.0)))))
    assert decision.parts == (Action.TURN_LEFT, Waypoint(1.0, 0.0))
    assert decision.kinds == {ActionKind.CHUNK, ActionKind.DISCRETE, ActionKind.WAYPOINT}
    assert (decision.action, decision.movement) == (Action.TURN_LEFT, None)


@pytest.mark.parametrize(
    "answer",
    [
        Waypoint(math.nan, 0.0),
        Waypoint(10_000.0, 0.0),
        Waypoint(1.0, 0.0, math.inf),
        Waypoint("1", 0.0),  # type: ignore[arg-type]
        Velocity(9_000.0, 0.0, 1.0),
        Velocity(0.2, 0.0, 3600.0),
        Velocity(0.2, 0.0, 0.0),
        Velocity(0.2, 0.0, 1.0, math.nan),
        Velocity(0.2, 0.0, 1.0, 11.0),
        Move(0.0, 1e9),
        Trajectory(((1.0, 0.0),)),
        Trajectory(tuple((float(k), 0.0) for k in range(12))),
        Trajectory(((1.0, 0.0), (2.0,))),  # type: ignore[arg-type]
        Trajectory(None),  # type: ignore[arg-type]
        Pixel(1e6, 0.0),
        Sidestep(6.0),
        Sidestep(math.nan),
        Chunk(()),
        Chunk((Action.STOP,) * (MAX_PARTS + 1)),
        Chunk((Chunk((Action.STOP,)),)),  # type: ignore[arg-type]
        Chunk((Action.WAYPOINT,)),
        Action.WAYPOINT,
    ],
)
def test_a_movement_that_cannot_be_executed_is_refused(answer: Movement | Chunk | Action) -> None:
    with pytest.raises(DecisionError):
        checked_decision(Decision(answer))


def test_an_action_that_does_not_fit_its_movement_is_refused() -> None:
    with pytest.raises(DecisionError):
        checked_decision(Decision(Action.VELOCITY, movement=Waypoint(1.0, 0.0)))
    with pytest.raises(DecisionError):
        checked_decision(Decision(Action.STOP, movement=Waypoint(1.0, 0.0)))


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"kind": "fly"},
        {"kind": "waypoint"},
        {"kind": "waypoint", "x_m": "a", "y_m": 0},
        None,
        [],
        {"kind": []},
        {"kind": "trajectory", "points": 3},
        {"kind": "velocity", "linear_m_s": 1e309},
    ],
)
def test_json_that_is_not_a_movement_is_refused(content: object) -> None:
    with pytest.raises(ValueError, match=r"movement|finite|convert"):
        movement_from_json(content)  # type: ignore[arg-type]


def test_a_velocity_without_a_part_to_the_side_is_written_as_before() -> None:
    assert Velocity(0.2, 0.1).to_json() == {
        "kind": "velocity",
        "linear_m_s": 0.2,
        "angular_rad_s": 0.1,
        "duration_s": 1.0,
    }
    aside = Velocity(0.3, 0.0, 2.0, -0.4)
    assert movement_from_json(aside.to_json()) == aside
    assert aside.reach_m == pytest.approx(1.0)
    assert aside.text == "0.30 m/s, 0.40 m/s to the right, 0°/s for 2.0 s"


@pytest.mark.parametrize(
    ("answer", "advice"),
    [
        (Waypoint(120.0, -30.0), "this looks like centimetres; in metres it is 1.23693"),
        (Move(25.0), "this looks like centimetres; in metres it is 0.25"),
        (Move(0.0, -90.0), "this looks like degrees; in radians it is 1.571"),
        (Waypoint(1.0, 0.0, 90.0), "this looks like degrees; in radians it is 1.571"),
        (Trajectory(((100.0, 0.0), (200.0, 0.0))), "this looks like centimetres; in metres it is 2"),
        (Move(1e6), ""),
    ],
)
def test_a_movement_in_another_unit_is_recognised(answer: Movement, advice: str) -> None:
    with pytest.raises(DecisionError) as refused:
        checked_decision(Decision(answer))
    assert refused.value.advice == advice
