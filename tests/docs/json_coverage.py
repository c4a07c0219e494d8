"""Finds the parts of the JSON schemas that no output has a value of."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from jsonschema import Draft202012Validator

from tests.docs.json_outputs import SCHEMAS, registry


def parts_without_a_value(outputs: Mapping[str, Sequence[Any]]) -> set[str]:
    """Return the parts of the commands' schemas that are absent, null or empty in every output.

    A part of a missing part is not returned.

    Args:
        outputs: command -> its outputs.

    Returns:
        Paths like `verify.checks[].notes[]`; `$` begins an object of common.json, `#1` is the second of several forms,
        and `{}` is a value of an object with any keys.
    """
    definitions = json.loads((SCHEMAS / "common.json").read_text(encoding="utf-8"))["$defs"]
    found: dict[str, bool] = {}

    def visit(schema: Any, values: list[Any], path: str) -> None:
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            path, schema = f"${name}", definitions[name]
        found[path] = found.get(path, False) or any(value is not None for value in values)
        for part, its_values, suffix in _parts(schema, values):
            visit(part, its_values, path + suffix)

    for command, values in outputs.items():
        schema = json.loads((SCHEMAS / f"{command.replace(' ', '-')}.json").read_text(encoding="utf-8"))
        visit(schema, list(values), command)
    missing = {path for path, has_value in found.items() if not has_value}
    return {
        path for path in missing if not any(path.startswith(f"{above}{mark}") for above in missing for mark in ".[{#")
    }


def _parts(schema: Any, values: list[Any]) -> Iterator[tuple[Any, list[Any], str]]:
    """Yield each part of a schema with its values and the suffix of its path."""
    for number, form in enumerate(schema.get("anyOf", schema.get("oneOf", ()))):
        if form != {"type": "null"}:
            validator = Draft202012Validator(form, registry=registry())
            yield form, [value for value in values if validator.is_valid(value)], f"#{number}"
    objects = [value for value in values if isinstance(value, dict)]
    for key, part in schema.get("properties", {}).items():
        yield part, [value[key] for value in objects if key in value], f".{key}"
    if isinstance(part := schema.get("additionalProperties"), dict):
        yield part, [item for value in objects for item in value.values()], "{}"
    if "items" in schema:
        yield schema["items"], [item for value in values if isinstance(value, list) for item in value], "[]"
