"""A policy's answer is validated completely, and the result is an independent copy."""

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsnbench.errors import DecisionError
from vsnbench.values.decision import Box, Decision, Diagnostics, GridMap
from vsnbench.values.decision_check import MOST_DETAILS_BYTES, checked_decision
from vsnbench.values.movement import Action

BOX = Box(1, 2, 3, 4, "sofa", 0.5)
GRID = GridMap(np.array([[0, 1, 2]], np.uint8), 0.0, 0.0, 0.05)


def decide(**parts: Any) -> Decision:
    return Decision(Action.TURN_LEFT, diagnostics=Diagnostics(**parts))


def cyclic() -> dict[str, Any]:
    loop: dict[str, Any] = {}
    loop["again"] = [loop]
    return loop


class Endless(Mapping[str, float]):
    def __getitem__(self, key: str) -> float:
        return 0.0

    def __len__(self) -> int:
        return 1

    def __iter__(self) -> Iterator[str]:
        number = 0
        while True:
            yield str(number)
            number += 1


MALFORMED: dict[str, tuple[Callable[[], object], str]] = {
    "no decision": (lambda: "forward", "expected a Decision, got a str"),
    "nothing": (lambda: None, "expected a Decision, got a NoneType"),
    "an action's name": (lambda: Decision("STOP", "STOP"), "must be an Action or a movement, got a str"),  # type: ignore[arg-type]
    "a raw action that is a number": (lambda: Decision(Action.STOP, 17), "raw_action must be text, got an int"),  # type: ignore[arg-type]
    "a lone surrogate": (lambda: Decision(Action.STOP, "\ud800"), "half of a surrogate pair"),
    "a NUL": (lambda: Decision(Action.STOP, "a\x00"), "a NUL character"),
    "diagnostics that are a mapping": (
        lambda: Decision(Action.STOP, "s", {"note": "x"}),
        "must be Diagnostics",
    ),  # type: ignore[arg-type]
    "a list of probabilities": (lambda: decide(probabilities=[0.5, 0.5]), "probabilities must be a mapping"),
    "a probability of 3": (lambda: decide(probabilities={"STOP": 3}), "put other numbers into scalars"),
    "a probability that is NaN": (lambda: decide(probabilities={"STOP": float("nan")}), "finite number, got nan"),
    "a scalar in words": (lambda: decide(scalars={"value": "0.5"}), r"scalars\['value'\] must be a number"),
    "a scalar of 5000 digits": (lambda: decide(scalars={"value": 10**5000}), "must be a number"),
    "scalars without end": (lambda: decide(scalars=Endless()), "at most 1000 entries"),
    "boxes that are no boxes": (
        lambda: decide(boxes=((1, 2, 3, 4, "sofa", 0.5),)),
        r"boxes\[0\] must be a Box, got a tuple",
    ),
    "a box at infinity": (
        lambda: decide(boxes=(Box(0, 0, float("inf"), 1, "sofa", 1),)),
        r"boxes\[0\].right must be a finite",
    ),
    "boxes in a generator": (lambda: decide(boxes=(BOX for _ in range(3))), "boxes must be a list"),
    "a million boxes": (lambda: decide(boxes=(BOX,) * 10**6), "at most 1000"),
    "a path in three dimensions": (lambda: decide(path=((1, 2, 3),)), r"path\[0\]"),
    "a sub-goal without y": (lambda: decide(sub_goal=(1.0,)), "sub_goal must be a point"),
    "a map that is an array": (lambda: decide(map=np.zeros((3, 3), np.uint8)), "map must be a GridMap"),
    "a map of floats": (lambda: decide(map=GridMap(np.zeros((3, 3)), 0, 0, 1)), "array of uint8"),  # type: ignore[arg-type]
    "an empty map": (lambda: decide(map=GridMap(np.zeros((0, 3), np.uint8), 0, 0, 1)), r"shape \(0, 3\)"),
    "a map of 4": (lambda: decide(map=GridMap(np.full((3, 3), 4, np.uint8), 0, 0, 1)), "must be 0 .unknown"),
    "a map without a scale": (lambda: decide(map=GridMap(GRID.cells, 0, 0, 0)), "resolution_m must be above 0"),
    "a note that is a list": (lambda: decide(note=["a"]), "note must be text, got a list"),
    "details that are a list": (lambda: decide(details=[1]), "details must be a mapping"),
    "details in a cycle": (lambda: decide(details=cyclic()), "contain themselves"),
    "details of 100 MB": (lambda: decide(details={"log": "x" * 10**8}), "at most 1 MiB"),
    "details of a million numbers": (lambda: decide(details={"logits": list(range(10**6))}), "at most 1 MiB"),
    "details of a large array": (lambda: decide(details={"rgb": np.zeros((480, 640, 3), np.uint8)}), "at most 1 MiB"),
    "details with a huge integer": (lambda: decide(details={"n": 10**5000}), "more than 64 bits"),
    "details with an object": (lambda: decide(details={"net": object()}), "JSON types only"),
    "details with bytes": (lambda: decide(details={"png": b"abc"}), "JSON types only"),
    "details that take our own key": (lambda: decide(details={"shown": 1}), "reserved key 'shown'"),
    "details with a tuple for a key": (
        lambda: decide(details={(1, 2): 3}),
        "keys of details must be text",
    ),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_an_invalid_decision_is_refused(name: str) -> None:
    make, words = MALFORMED[name]
    with pytest.raises(DecisionError, match=words) as refused:
        checked_decision(make())
    assert len(str(refused.value)) < 600


def test_what_numpy_gives_is_kept_as_plain_numbers() -> None:
    kept = checked_decision(
        decide(
            probabilities={"STOP": np.float32(0.25)},
            scalars={"value": np.array(2.5), "unknown": float("nan")},
            boxes=[BOX],
            path=np.array([[0.0, 1.0], [2.0, 3.0]]),
            map=GRID,
            details={"logits": np.array([1.5, np.inf]), 3: (True, None, np.int64(4))},
        )
    ).diagnostics
    assert kept.probabilities == {"STOP": 0.25}
    assert type(kept.scalars["value"]) is float
    assert str(kept.scalars["unknown"]) == "nan"
    assert kept.boxes == (BOX,)
    assert kept.path == ((0.0, 1.0), (2.0, 3.0))
    assert kept.details == {"logits": [1.5, None], "3": [True, None, 4]}


def test_later_changes_by_the_policy_have_no_effect() -> None:
    details: dict[str, Any] = {"seen": [1]}
    scalars = {"value": 1.0}
    cells = np.ones((2, 2), np.uint8)
    kept = checked_decision(decide(details=details, scalars=scalars, map=GridMap(cells, 0, 0, 1))).diagnostics
    details["seen"].append(object())
    scalars.clear()
    cells[:] = 9
    assert kept.details == {"seen": [1]}
    assert kept.scalars == {"value": 1.0}
    assert kept.map is not None
    assert kept.map.cells.max() == 1


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=20,
)


@given(st.dictionaries(st.text(max_size=8), ANYTHING, max_size=5))
def test_details_are_refused_in_words_or_become_json_of_bounded_size(details: dict[str, Any]) -> None:
    try:
        kept = checked_decision(decide(details=details)).diagnostics.details
    except DecisionError:
        return
    assert len(json.dumps(kept, allow_nan=False)) < 6 * MOST_DETAILS_BYTES
