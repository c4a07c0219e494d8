"""Quantities of a record: each is declared once, as a field of a value type with `quantity`.

The name, the type, the SQL expression and the meaning of a quantity stand in its declaration. The SELECT, the value,
the columns of tables, the JSON object and its schema are derived from it. Units are in the names: `_m`, `_s`, `_rad`.
"""

import dataclasses
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from datetime import datetime
from enum import StrEnum
from functools import cache, reduce
from operator import or_
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from sqlalchemy import case

from vsnbench.results.reading.read_model import CODE
from vsnbench.values.fix import Fix
from vsnbench.values.movement import Movement
from vsnbench.values.placement import PoseCovariance
from vsnbench.values.pose import Pose

_DECLARATION = "quantity"
_JSON_TYPES: Mapping[Any, str] = {bool: "boolean", int: "integer", float: "number", str: "string", datetime: "string"}
_SHARED: Mapping[Any, str] = {Pose: "pose", Fix: "fix", PoseCovariance: "covariance", Movement: "movement"}
"""Type -> its name in docs/schemas/common.json."""
_OF_POSE = ("_x_m", "_y_m", "_heading_rad")
_OF_FIX = (*_OF_POSE, "_source")
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True)
class Field:
    """A quantity of a record."""

    name: str
    type: Any
    """Python type; with None if the quantity can be unknown."""
    meaning: str
    sql: Sequence[Any] = ()
    """SQL expressions that it is read from; none for a quantity that a SELECT does not read."""
    decode: Callable[..., Any] | None = None
    """Returns the value of the SQL expressions; None for the value of a single expression."""
    absent: str = "if unknown"
    """When it has no value."""
    is_hidden: bool = False
    """Whether it has no value for an arm of a blinded study, because it could identify the model."""
    column: str = ""
    """Its name in a table that also has quantities of other things."""
    get: Callable[[Any], Any] | None = None
    """Returns the quantity of a value; None for the attribute of this name."""

    @property
    def is_optional(self) -> bool:
        """Whether it can be unknown."""
        return type(None) in get_args(self.type)

    @property
    def base(self) -> Any:
        """The type without None."""
        return (
            reduce(or_, (part for part in get_args(self.type) if part is not type(None)))
            if self.is_optional
            else self.type
        )

    @property
    def heading(self) -> str:
        """The name of its column in a table."""
        return self.column or self.name

    @property
    def nothing(self) -> Any:
        """The value that stands for a hidden one."""
        return None if self.is_optional else {} if get_origin(self.type) is dict else self.type()

    def description(self, nothing: str = "null") -> str:
        """Return the meaning, with what stands for an unknown value."""
        return f"{self.meaning}; {nothing} {self.absent}" if self.is_optional else self.meaning

    def raw(self, value: Any) -> Any:
        """Return the quantity of a value."""
        return getattr(value, self.name) if self.get is None else self.get(value)

    def of(self, value: Any) -> Any:
        """Return the quantity of a value, as in JSON."""
        return as_json(self.raw(value))


def quantity(
    meaning: str,
    *sql: Any,
    decode: Callable[..., Any] | None = None,
    absent: str = "if unknown",
    hidden: bool = False,
    column: str = "",
) -> Any:
    """Declare a field of a dataclass as a quantity of a record; see `Field`."""
    declared = {"meaning": meaning, "sql": sql, "decode": decode, "absent": absent}
    return dataclasses.field(metadata={_DECLARATION: declared | {"is_hidden": hidden, "column": column}})


class Fields:
    """The quantities of one kind of thing, in order."""

    def __init__(self, declared: Iterable[Field]) -> None:
        self._by_name = {field.name: field for field in declared}

    def __iter__(self) -> Iterator[Field]:
        return iter(self._by_name.values())

    def __getitem__(self, name: str) -> Field:
        return self._by_name[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in order."""
        return tuple(self._by_name)

    @property
    def hidden(self) -> frozenset[str]:
        """Names of the quantities that an arm of a blinded study does not have."""
        return frozenset(field.name for field in self if field.is_hidden)

    def only(self, *names: str) -> "Fields":
        """Return some of the quantities, in this order."""
        return Fields(self[name] for name in names)

    def but(self, *names: str) -> "Fields":
        """Return the quantities except some."""
        return Fields(field for field in self if field.name not in names)

    def single(self, *besides: str) -> "Fields":
        """Return the same quantities for tables that are read as arrays, the first SQL expression of each.

        Raises:
            TypeError: one is computed from several, and is not among `besides`.
        """
        for field in self:
            if len(field.sql) > 1 and field.name not in besides:
                raise TypeError(f"{field.name} is computed from several columns: declare it as one SQL expression")
        return self

    def columns(self) -> list[Any]:
        """Return the SQL expressions to select, each once; hidden quantities of blinded arms are NULL.

        The query must join Campaign if a quantity is hidden.
        """
        wanted = {(id(expression), field.is_hidden): expression for field in self for expression in field.sql}
        return [
            case((CODE.is_(None), expression), else_=None) if is_hidden else expression
            for (_, is_hidden), expression in wanted.items()
        ]

    def rows(self, selected: Iterable[Sequence[Any]]) -> Iterator[list[Any]]:
        """Yield the values of rows of `columns`: one for each quantity that is read, in order."""
        places: dict[tuple[int, bool], int] = {}
        readers: list[tuple[int, Callable[..., Any] | None, tuple[int, ...]]] = []
        for field in self:
            own = tuple(places.setdefault((id(expression), field.is_hidden), len(places)) for expression in field.sql)
            if own:
                readers.append((own[0], field.decode, own))
        for row in selected:
            yield [
                row[first] if decode is None else decode(*[row[place] for place in own])
                for first, decode, own in readers
            ]

    def read(self, kind: type[Value], selected: Iterable[Sequence[Any]], **others: Any) -> Iterator[Value]:
        """Yield the values of a type, of rows of `columns`.

        Its first fields are the quantities that a SELECT reads, in this order; `others` are the rest.
        """
        for values in self.rows(selected):
            yield kind(*values, **others)

    def json(self, value: Any) -> dict[str, Any]:
        """Return a value as a JSON object."""
        return {field.name: field.of(value) for field in self}

    def headings(self) -> list[str]:
        """Return the names of the columns of a table; poses have a column for each number."""
        return [f"{field.heading}{suffix}" for field in self for suffix in _suffixes(field.type)]

    def cells(self, value: Any) -> list[Any]:
        """Return the row of a value, for the columns of `headings`; unknown values are empty."""
        return [cell for field in self for cell in _cells(field, field.raw(value))]

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema of an object of `json`."""
        properties = {field.name: {**schema_of(field.type), "description": field.description()} for field in self}
        return {"type": "object", "properties": properties, "required": list(self.names)}


@cache
def fields_of(kind: type[Any]) -> Fields:
    """Return the quantities that are declared as fields of a dataclass."""
    hints = get_type_hints(kind)
    return Fields(
        Field(field.name, hints[field.name], **field.metadata[_DECLARATION])
        for field in fields(kind)
        if _DECLARATION in field.metadata
    )


def without_hidden(value: Value) -> Value:
    """Return a value of declared quantities without those that could identify the model of a blinded study."""
    kind: Any = type(value)
    declared = fields_of(kind)
    return replace(value, **{name: declared[name].nothing for name in declared.hidden})  # type: ignore[type-var]


def as_json(value: Any) -> Any:
    """Return a value of a quantity as JSON; times stay values, which the encoder writes in ISO 8601."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return [as_json(item) for item in value] if isinstance(value, tuple) else value


def schema_of(kind: Any) -> dict[str, Any]:
    """Return the JSON Schema of a type, without a description."""
    if kind in _SHARED:
        return {"$ref": f"common.json#/$defs/{_SHARED[kind]}"}
    if kind in _JSON_TYPES:
        return {"type": _JSON_TYPES[kind]}
    parts = get_args(kind)
    if get_origin(kind) in (Union, types.UnionType):
        return _or_null(schema_of(reduce(or_, (part for part in parts if part is not type(None)))))
    if get_origin(kind) is Literal:
        return {"enum": list(parts)}
    if get_origin(kind) is tuple and Ellipsis in parts:
        return {"type": "array", "items": schema_of(parts[0])}
    if get_origin(kind) is tuple:
        return {"type": "array", "items": schema_of(parts[0]), "minItems": len(parts), "maxItems": len(parts)}
    if get_origin(kind) is not None and issubclass(get_origin(kind), Mapping):
        return {"type": "object", "additionalProperties": True}
    if issubclass(kind, StrEnum):
        return {"type": "string"}
    return fields_of(kind).schema()


def _suffixes(kind: Any) -> tuple[str, ...]:
    kinds = {kind, *get_args(kind)}
    return _OF_FIX if Fix in kinds else _OF_POSE if Pose in kinds else ("",)


def _cells(field: Field, value: Any) -> list[Any]:
    suffixes = _suffixes(field.type)
    if value is None:
        return [""] * len(suffixes)
    if isinstance(value, Fix):
        return [value.pose.x_m, value.pose.y_m, value.pose.heading_rad, value.source.value]
    if isinstance(value, Pose):
        return [value.x_m, value.y_m, value.heading_rad]
    return [value.isoformat() if isinstance(value, datetime) else value]


def _or_null(schema: dict[str, Any]) -> dict[str, Any]:
    return {**schema, "type": [schema["type"], "null"]} if "type" in schema else {"anyOf": [schema, {"type": "null"}]}
