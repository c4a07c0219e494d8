"""Builds a stored report again from the record, and compares every number."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vsnbench.errors import RecordError
from vsnbench.files.bounded_json import parse_json
from vsnbench.verification.checks import Check, Finding, finding

_MOST_BYTES = 64 * 2**20


def compare_reports(check: Check, name: str, stored: Path, rebuilt: str) -> None:
    """Compare a stored JSON report with the rebuilt one, value by value.

    Raises:
        RecordError: the stored file is too large.
    """
    content = stored.read_bytes() if stored.stat().st_size <= _MOST_BYTES else None
    if content is None:
        raise RecordError(f"{name} is larger than {_MOST_BYTES // 2**20} MiB")
    if content == rebuilt.encode():
        check.checked += sum(1 for _ in _values(parse_json(content)))
        return
    before, now = dict(_values(parse_json(content))), dict(_values(json.loads(rebuilt)))
    check.checked += len(before.keys() | now.keys())
    differing = list(_differences(name, before, now))
    check.failed += len(differing)
    check.findings += differing
    if not differing:
        check.fail(name, "its bytes differ, and no value")


def _differences(name: str, before: dict[str, Any], now: dict[str, Any]) -> Iterator[Finding]:
    absent = object()
    for path in dict.fromkeys((*before, *now)):
        stored, rebuilt = before.get(path, absent), now.get(path, absent)
        if stored != rebuilt or type(stored) is not type(rebuilt):
            said = "missing" if stored is absent else json.dumps(stored)
            gives = "nothing" if rebuilt is absent else json.dumps(rebuilt)
            yield finding(f"{name} {path}", f"{said}, and the record gives {gives}")


def _values(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every value with its place, such as `models[0].total.successes`."""
    if isinstance(content, dict) and content:
        for key, value in content.items():
            yield from _values(value, f"{path}.{key}" if path else str(key))
    elif isinstance(content, list) and content:
        for place, value in enumerate(content):
            yield from _values(value, f"{path}[{place}]")
    else:
        yield path, content
