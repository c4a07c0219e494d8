"""Tables and JSON schema of the kinds of movements, from what their classes in `vsnbench.values.movement` declare."""

import inspect
from typing import Any, get_args

from vsnbench.results.fields import schema_of
from vsnbench.values.movement import Drive, Movement
from vsnbench.values.movement_base import MovementBase, Parameter

_HEADS = {
    "answers": "| answer | meaning, in the robot's frame at the observation | parameters |",
    "messages": "| `kind` | meaning | other keys |",
}


def table(form: str) -> str:
    """Return the table of all kinds, as `answers` of a policy in Python or as `messages` of the wire."""
    rows = [_HEADS[form], "| --- | --- | --- |"]
    for movement in get_args(Movement):
        parameters = [parameter for parameter in movement.parameters() if not parameter.is_internal]
        arguments = ", ".join(p.name if p.default is ... else f"{p.name}={p.default}" for p in parameters)
        name = f"{movement.__name__}({arguments})" if form == "answers" else movement.kind.value
        meaning = f"{_meaning(movement)}; {movement.limit}" if movement.limit else _meaning(movement)
        described = " ".join(_described(parameter, form) for parameter in parameters)
        rows.append(f"| `{name}` | {meaning} | {described} |")
    return "\n".join(rows) + "\n"


def schema() -> dict[str, Any]:
    """Return the JSON schema of a movement."""
    return {"anyOf": [_schema_of(movement) for movement in get_args(Movement)]}


def adapter_kinds() -> list[str]:
    """Return the kinds that a motion adapter can execute."""
    return [movement.kind.value for movement in get_args(Drive)]


def _schema_of(movement: type[MovementBase]) -> dict[str, Any]:
    parameters = movement.parameters()
    properties = {parameter.name: _property_of(parameter) for parameter in parameters}
    return {
        "type": "object",
        "properties": {"kind": {"const": movement.kind.value, "description": _meaning(movement)}, **properties},
        "required": ["kind", *(parameter.name for parameter in parameters if not parameter.absent)],
    }


def _property_of(parameter: Parameter) -> dict[str, Any]:
    kind = float if parameter.type == float | None else parameter.type
    absent = f"; absent {parameter.absent}" if parameter.absent else ""
    return {**schema_of(kind), "description": f"{parameter.meaning}{absent}"}


def _meaning(movement: type[MovementBase]) -> str:
    """Return the first sentence of a docstring, for a cell of a table."""
    text = (inspect.getdoc(movement) or "").split("\n\n")[0].replace("\n", " ").removesuffix(".")
    return text[0].lower() + text[1:]


def _described(parameter: Parameter, form: str) -> str:
    notes = [parameter.limits]
    if form == "messages" and parameter.default is not ...:
        notes.append("optional" if parameter.default is None else f"{parameter.default:g} if absent")
    note = ", ".join(filter(None, notes))
    return f"`{parameter.name}`{f' ({note})' if note else ''}: {parameter.meaning}."
