"""Makes the report and the tables of a bundle again from its record, and compares every value.

Numbers may differ in their last digits, because libraries for linear algebra add in another order on another processor.
The hashes of the bundle find every other byte.
"""

import csv
import json
import math
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from vsnbench.bundle.derived_files import write_derived_files
from vsnbench.files.bounded_json import parse_json
from vsnbench.study.lock import LockNote
from vsnbench.verification.checks import Check, Finding, Progress, finding

FOLDERS = ("conditions", "report", "study", "tables")
ENVIRONMENT = "environment.json"
_MOST_BYTES = 2**30
_ABSENT = object()
_TOLERANCE = 1e-9


def check_derived_files(bundle: Path, results: Path, scratch: Path, note: LockNote | None, progress: Progress) -> Check:
    """Write the report, tables and conditions of a bundle again, and compare them with those in it.

    `results` has a copy of its database; the files are written to `scratch`.
    """
    check = Check("report", "tables")
    with check.failing("report"):
        progress("making the report again", 0, 2)
        write_derived_files(results, scratch, note)
        progress("making the report again", 1, 2)
        names = {name for directory in (bundle, scratch) for name in _names(directory)}
        for name in sorted(names):
            with check.failing(name):
                check.add(list(_differences(name, bundle / name, scratch / name)))
    progress("making the report again", 2, 2)
    return check


def _names(directory: Path) -> Iterator[str]:
    for folder in FOLDERS:
        yield from (path.relative_to(directory).as_posix() for path in (directory / folder).glob("*"))
    if (directory / ENVIRONMENT).exists():
        yield ENVIRONMENT


def _differences(name: str, stored: Path, made: Path) -> Iterator[Finding]:
    if not stored.is_file() or not made.is_file():
        yield finding(name, "is missing" if made.is_file() else "does not follow from the record")
    elif stored.stat().st_size > _MOST_BYTES:
        yield finding(name, "is too large to be compared")
    elif stored.read_bytes() != made.read_bytes():
        compare = {".json": _json, ".csv": _csv}.get(stored.suffix, _lines)
        yield from compare(name, stored, made)


def _json(name: str, stored: Path, made: Path) -> Iterator[Finding]:
    before, now = dict(_values(parse_json(stored.read_bytes()))), dict(_values(json.loads(made.read_bytes())))
    for path in dict.fromkeys((*before, *now)):
        given, follows = before.get(path, _ABSENT), now.get(path, _ABSENT)
        if not _is_same(given, follows):
            yield finding(f"{name}: {path}", f"{_shown(given)}, and the record gives {_shown(follows)}")


def _is_same(given: object, follows: object) -> bool:
    if isinstance(given, float) and isinstance(follows, float):
        return math.isclose(given, follows, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    return given == follows and type(given) is type(follows)


def _number(text: str) -> float | str:
    try:
        return float(text) if "." in text else text
    except ValueError:
        return text


def _shown(value: object) -> str:
    return "nothing" if value is _ABSENT else json.dumps(value, ensure_ascii=False)[:100]


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


def _csv(name: str, stored: Path, made: Path) -> Iterator[Finding]:
    with stored.open(encoding="utf-8", newline="") as given, made.open(encoding="utf-8", newline="") as expected:
        follows = csv.reader(expected)
        columns = next(follows, [])
        rows = csv.reader(given)
        if next(rows, []) != columns:
            yield finding(f"{name} row 0", "has other columns than the record")
            return
        for number, (row, now) in enumerate(zip_longest(rows, follows), start=1):
            if row is None or now is None or len(row) != len(now):
                yield finding(
                    f"{name} row {number}", "is missing" if row is None else "does not follow from the record"
                )
                continue
            for column, value, expects in zip(columns, row, now, strict=False):
                if not _is_same(_number(value), _number(expects)):
                    text = f"{value[:100]!r}, and the record gives {expects[:100]!r}"
                    yield finding(f"{name} row {number}: {column}", text)


def _lines(name: str, stored: Path, made: Path) -> Iterator[Finding]:
    given, expected = (path.read_text(encoding="utf-8", errors="replace").split("\n") for path in (stored, made))
    for number, (line, now) in enumerate(zip_longest(given, expected), start=1):
        if line != now:
            yield finding(f"{name} line {number}", f"{str(line)[:100]!r}, and the record gives {str(now)[:100]!r}")
            return
