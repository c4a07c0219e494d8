"""A measure is one declaration for tables, JSON and the schema."""

import math

from jsonschema import Draft202012Validator

from vsnbench.report.measures import (
    COUNT,
    TEXT,
    Measure,
    Measures,
    an_object,
    decimals,
    intervals,
    objects,
    percents,
    values,
)
from vsnbench.statistics.rates import UNKNOWN, Interval

PART = Measures.shared(
    "part",
    Measure("name", TEXT, "name of the part"),
)
ROW = Measures(
    Measure("name", TEXT, "name", heading="name", note=""),
    Measure("rate", percents(1), "share of successes", heading="SR %"),
    Measure("ci", intervals(1), "the interval of the rate", heading="interval", note="percent", rank=2),
    Measure("", COUNT, "episodes with a doubt", lambda row: row["n"], heading="n"),
    Measure("seconds", decimals(2), "time", null="in simulation"),
    Measure("start", COUNT, "starting position", only_in="`starts`"),
    Measure("parts", objects(PART), "parts"),
    Measure("best", an_object(PART), "best part", null="without any"),
    Measure("marks", values(COUNT), "marks"),
)
KNOWN = {
    "name": "a",
    "rate": 0.5,
    "ci": Interval(0.25, 0.75),
    "n": 3,
    "seconds": 1.5,
    "start": 4,
    "parts": [{"name": "b"}],
    "best": {"name": "b"},
    "marks": (1, 2),
}
UNKNOWN_ROW = KNOWN | {"rate": math.nan, "ci": UNKNOWN, "seconds": math.inf, "start": None, "best": None}


def test_a_table_shows_the_measures_with_a_heading() -> None:
    table = ROW.table("rows", "Rows", [KNOWN, UNKNOWN_ROW])
    assert [(each.heading, each.number, each.note, each.rank) for each in table.columns] == [
        ("name", False, "", 0),
        ("SR %", True, "share of successes", 0),
        ("interval", True, "percent", 2),
        ("n", True, "episodes with a doubt", 0),
    ]
    assert [[cell.text for cell in row.cells] for row in table.rows] == [
        ["a", "50.0", "[25.0, 75.0]", "3"],
        ["a", "–", "–", "3"],
    ]


def test_json_has_the_measures_with_a_key_and_null_for_what_is_unknown() -> None:
    assert ROW.fields(KNOWN) == {
        "name": "a",
        "rate": 0.5,
        "ci_low": 0.25,
        "ci_high": 0.75,
        "seconds": 1.5,
        "start": 4,
        "parts": [{"name": "b"}],
        "best": {"name": "b"},
        "marks": [1, 2],
    }
    unknown = dict.fromkeys(("rate", "ci_low", "ci_high", "seconds", "best"))
    assert ROW.fields(UNKNOWN_ROW).items() >= unknown.items()
    assert "start" not in ROW.fields(UNKNOWN_ROW)


def test_the_schema_says_of_what_a_value_may_be_null_and_where_a_key_is() -> None:
    schema = ROW.schema
    properties = schema["properties"]
    assert properties["ci_low"]["description"] == "lower limit of the interval of the rate; null if unknown"
    assert properties["seconds"] == {"type": ["number", "null"], "description": "time; null in simulation"}
    assert properties["start"] == {"type": "integer", "description": "starting position; only in `starts`"}
    assert properties["best"]["anyOf"] == [{"$ref": "common.json#/$defs/part"}, {"type": "null"}]
    assert set(schema["required"]) == properties.keys() - {"start"}
    del properties["parts"], properties["best"]  # they refer to common.json
    for row in (KNOWN, UNKNOWN_ROW):
        Draft202012Validator(schema).validate(ROW.fields(row))
