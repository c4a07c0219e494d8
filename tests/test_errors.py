"""Error messages: the problem, and separately the fix."""

import pickle

import pytest

from vsnbench.errors import ModelError, RecordError, SensorNotDeclaredError, UsageError, VsnbenchError


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (UsageError("no goal given", advice="name one with --goal"), "no goal given: name one with --goal"),
        (RecordError("cannot write a: disk full", advice="free some"), "cannot write a: disk full; free some"),
        (UsageError("which episode?", advice="`vsnbench judge --pending` lists them"),
         "which episode? `vsnbench judge --pending` lists them"),
        (ModelError("spoilt"), "spoilt"),
        (ModelError(), ""),
    ],
)  # fmt: skip
def test_one_line_is_made_of_statement_and_advice(error: VsnbenchError, line: str) -> None:
    assert str(error) == line


@pytest.mark.parametrize("kind", [UsageError, SensorNotDeclaredError])
def test_both_parts_reach_another_process(kind: type[VsnbenchError]) -> None:
    there = pickle.loads(pickle.dumps(kind("it is gone", advice="look elsewhere")))
    assert (type(there), there.statement, there.advice) == (kind, "it is gone", "look elsewhere")
