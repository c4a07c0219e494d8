"""Measures: what a table says of its rows, declared once for every format.

A measure has a key in CSV and JSON, a heading, a format, an explanation and a function. From a list of measures come
the columns and cells of a table, JSON objects, CSV lines and the JSON schema (`docs/schemas`).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from enum import Enum
from functools import cached_property
from typing import Any, Self

from vsnbench.report.table import (
    EMPTY,
    Column,
    ReportTable,
    Row,
    TableCell,
    decimal,
    interval_cell,
    of,
    p_cell,
)
from vsnbench.statistics.rates import UNKNOWN, Interval, Proportion

COMMON = "common.json#/$defs/"
"""Where the schemas refer to for objects that several commands print."""


def known(value: Any) -> Any:
    """Return a value for JSON: null for numbers that JSON cannot represent, texts for enums and times."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {known(name): known(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [known(item) for item in value]
    if isinstance(value, Enum):
        return value.value
    return value.isoformat() if isinstance(value, datetime) else value


def _text(value: Any) -> TableCell:
    return EMPTY if value is None else value if isinstance(value, TableCell) else TableCell(str(value))


def _count(value: int | None) -> TableCell:
    return EMPTY if value is None else TableCell(str(value), value)


Part = Callable[[Any], Any] | str
"""A part of a row: a function, or the path of an attribute or item, like `rate.interval`."""


def part_of(row: Any, part: Part) -> Any:
    """Return a part of a row."""
    if callable(part):
        return part(row)
    for name in part.split("."):
        row = row[name] if isinstance(row, Mapping) else getattr(row, name)
    return row


@dataclass(frozen=True, slots=True)
class Form:
    """How the values of a measure appear in tables and in JSON."""

    schema: Mapping[str, Any]
    """JSON schema of a value that is known."""
    cell: Callable[[Any], TableCell] = _text
    number: bool = True
    """Whether cells are right-aligned."""
    json: Callable[[Any], Any] = known
    is_interval: bool = False
    """The value is an `Interval`, which JSON has as two numbers."""
    null: str = ""
    """When JSON has null, unless the measure states it."""


TEXT = Form({"type": "string"}, number=False)
COUNT = Form({"type": "integer"}, _count)
_UNKNOWN = "if unknown"
KNOWN_COUNT = Form({"type": "integer"}, _count, null=_UNKNOWN)
NUMBER = Form({"type": "number"}, null=_UNKNOWN)
FLAG = Form({"type": "boolean"}, number=False)
P = Form({"type": "number"}, lambda p: p_cell(math.nan if p is None else p), null=_UNKNOWN)
ANYTHING = Form({"type": "object", "additionalProperties": True})
COUNTS = Form({"type": "object", "additionalProperties": {"type": "integer"}})
RATIO = Form({}, lambda parts: of(*parts))
"""A part and its whole, only in tables."""
CELL = Form({}, lambda cell: cell)
"""A cell, only in tables."""


def decimals(places: int, factor: int = 1, unit: int = 1) -> Form:
    """Return the form of a number with decimals; a table shows it times a factor, in multiples of a unit."""
    return Form(
        {"type": "number"},
        lambda value: decimal(math.nan if value is None else factor * value / unit, places),
        null=_UNKNOWN,
    )


def percents(places: int = 2) -> Form:
    """Return the form of a number from 0 to 1, which a table shows in percent."""
    return decimals(places, 100)


def intervals(places: int = 2, factor: int = 100) -> Form:
    """Return the form of an interval, in percent by default; JSON has its ends as `KEY_low` and `KEY_high`."""
    return Form(
        {"type": "number"},
        lambda interval: interval_cell(interval or UNKNOWN, places, factor),
        is_interval=True,
        null=_UNKNOWN,
    )


@dataclass(frozen=True, slots=True)
class Measure:
    """A quantity of the rows of a table."""

    key: str
    """Name in CSV and JSON; empty for what only tables have."""
    form: Form
    meaning: str = ""
    """Explanation in the JSON schema and of the heading."""
    of: Part = ""
    """Its value; by default the attribute or item of this key."""
    null: str | None = None
    """When JSON has null, like `without episodes`, if not as for the form; empty if never."""
    heading: str = ""
    """Heading of its column; empty for what only CSV and JSON have."""
    note: str | None = None
    """Explanation of the heading, if it differs from `meaning`; empty for a heading that needs none."""
    rank: int = 0
    """Columns with the highest rank are dropped first if the table is too wide; rank 0 is always shown."""
    only_in: str = ""
    """Lists whose objects have the key, if not all have it."""

    def value(self, row: Any) -> Any:
        """Return the value for a row."""
        return part_of(row, self.of or self.key)

    @property
    def column(self) -> Column:
        """Column of a table."""
        note = self.meaning if self.note is None else self.note
        return Column(self.heading, self.form.number, note, self.rank)

    def fields(self, row: Any) -> Iterator[tuple[str, Any]]:
        """Yield the keys and values of CSV and JSON."""
        value = self.value(row)
        if self.form.is_interval:
            interval: Interval = value or UNKNOWN
            yield f"{self.key}_low", known(interval.low)
            yield f"{self.key}_high", known(interval.high)
        elif not (self.only_in and value is None):
            yield self.key, None if value is None else self.form.json(value)

    def schemas(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield the keys with their schemas."""
        if self.form.is_interval:
            for end, word in (("low", "lower"), ("high", "upper")):
                yield f"{self.key}_{end}", self._schema(f"{word} limit of {self.meaning}")
        else:
            yield self.key, self._schema(self.meaning)

    def _schema(self, meaning: str) -> dict[str, Any]:
        null = self.form.null if self.null is None else self.null
        description = meaning + (f"; null {null}" if null else "")
        description += f"; only in {self.only_in}" if self.only_in else ""
        schema = dict(self.form.schema)
        if null and "$ref" in schema:
            schema = {"anyOf": [schema, {"type": "null"}]}
        elif null:
            schema["type"] = [schema["type"], "null"]
        return {**schema, "description": description}


class Measures(tuple[Measure, ...]):
    """The measures of a table, from left to right, or of a JSON object."""

    common: str = ""
    """Name of the object among those of common.json."""

    def __new__(cls, *measures: Measure) -> Self:
        """Return measures in order."""
        return super().__new__(cls, measures)

    @classmethod
    def shared(cls, name: str, *measures: Measure) -> Self:
        """Return the measures of an object to which several schemas refer by name."""
        found = cls(*measures)
        found.common = name
        return found

    def named(self, key: str) -> Measure:
        """Return the measure with this key."""
        return next(measure for measure in self if measure.key == key)

    def in_columns(self, *names: str) -> "Measures":
        """Return the same measures with columns in this order, named by heading or key, where JSON has another."""
        found = Measures(*self)
        by_name = {measure.key: measure for measure in self.shown} | {
            measure.heading: measure for measure in self.shown
        }
        found.shown = tuple(by_name[name] for name in names)
        return found

    @cached_property
    def shown(self) -> tuple[Measure, ...]:
        """The measures that tables show."""
        return tuple(measure for measure in self if measure.heading)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of a table."""
        return tuple(measure.column for measure in self.shown)

    def cells(self, row: Any) -> tuple[TableCell, ...]:
        """Return the cells of a row."""
        return tuple(measure.form.cell(measure.value(row)) for measure in self.shown)

    def row(self, row: Any, *first: TableCell, total: bool = False) -> Row:
        """Return a row of a table, with cells before those of the measures."""
        return Row((*first, *self.cells(row)), total)

    def table(self, name: str, title: str, rows: Iterable[Any], **others: Any) -> ReportTable:
        """Return a table of these measures; other arguments are those of `ReportTable`."""
        return ReportTable(name, title, self.columns, tuple(map(self.row, rows)), **others)

    def fields(self, row: Any) -> dict[str, Any]:
        """Return a row as a JSON object; CSV has the same keys."""
        return {key: value for measure in self if measure.key for key, value in measure.fields(row)}

    @property
    def schema(self) -> dict[str, Any]:
        """JSON schema of the object."""
        keyed = [measure for measure in self if measure.key]
        return {
            "type": "object",
            "properties": {key: schema for measure in keyed for key, schema in measure.schemas()},
            "required": [key for measure in keyed if not measure.only_in for key, _ in measure.schemas()],
        }

    def within(self, part: Part) -> "Measures":
        """Return the same measures of a part of a row."""

        def of(measure: Measure) -> Callable[[Any], Any]:
            return lambda row: measure.value(part_of(row, part))

        return Measures(*(replace(measure, of=of(measure)) for measure in self))

    @property
    def reference(self) -> dict[str, Any]:
        """Schema of the object where another refers to it."""
        return {"$ref": f"{COMMON}{self.common}"} if self.common else self.schema


def an_object(measures: Measures) -> Form:
    """Return the form of an object in JSON."""
    return Form(measures.reference, json=measures.fields)


def objects(measures: Measures) -> Form:
    """Return the form of a list of objects in JSON."""
    return Form(
        {"type": "array", "items": measures.reference}, json=lambda rows: [measures.fields(row) for row in rows]
    )


def values(form: Form) -> Form:
    """Return the form of a list of values in JSON."""
    return Form({"type": "array", "items": form.schema}, json=lambda several: [form.json(value) for value in several])


TEXTS, NUMBERS = values(TEXT), values(COUNT)


def rates(proportion: Part, interval: Part, places: int = 2) -> tuple[Measure, ...]:
    """Return the measures of a success rate: k/n, percent and 95 % interval; JSON has both counts.

    Args:
        proportion: successes and episodes of a row.
        interval: interval of its success rate; None if it has none.
        places: decimals of the percentages.
    """

    def of(name: str) -> Callable[[Any], Any]:
        return lambda row: getattr(part_of(row, proportion), name)

    def counts(row: Any) -> tuple[int, int]:
        known: Proportion = part_of(row, proportion)
        return known.successes, known.trials

    rate = Measure("success_rate", percents(places), "share of successes", of("rate"), null="without episodes")
    limits = Measure("ci", intervals(places), "the 95 % interval of the success rate", interval)
    return (
        Measure("successes", COUNT, "number of successes", of("successes")),
        Measure("episodes", COUNT, "number of episodes", of("trials")),
        Measure("", RATIO, of=counts, heading="k/n"),
        replace(rate, heading="SR %", note=""),
        replace(limits, heading="95 % interval", note=""),
    )
