"""Makes the report and the tables of a bundle again from its record, and compares every value.

Numbers may differ in their last digits, because libraries for linear algebra add in another order on another processor.
The hashes of the bundle find every other byte. A bundle of another version may lack keys, columns and files that were
added later, and its texts may have other words; everything else must be the same.
"""

import csv
import json
import math
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from vsnbench import __version__
from vsnbench.evidence.bundle.derived_files import ENVIRONMENT, MADE_BY, write_derived_files
from vsnbench.evidence.verification.checks import Check, Finding, Progress, finding
from vsnbench.files.bounded_json import parse_json
from vsnbench.study.lock import LockNote

FOLDERS = ("conditions", "report", "study", "tables")
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
        version = _version(bundle / ENVIRONMENT)
        names = {name for directory in (bundle, scratch) for name in _names(directory)}
        for name in sorted(names):
            with check.failing(name):
                _compare(check, name, bundle / name, scratch / name, "" if version == __version__ else version)
    progress("making the report again", 2, 2)
    return check


def _names(directory: Path) -> Iterator[str]:
    for folder in FOLDERS:
        yield from (path.relative_to(directory).as_posix() for path in (directory / folder).glob("*"))
    if (directory / ENVIRONMENT).exists():
        yield ENVIRONMENT


def _version(environment: Path) -> str:
    """Return the version of vsnbench that made a bundle; this version if it is not named."""
    if not environment.is_file() or environment.stat().st_size > _MOST_BYTES:
        return __version__
    content = parse_json(environment.read_bytes())
    return str(content.get(MADE_BY, __version__)) if isinstance(content, dict) else __version__


def _compare(check: Check, name: str, stored: Path, made: Path, other: str) -> None:
    """Compare a file of a bundle with the one made again; `other` is the bundle's version if it is not this one."""
    if not stored.is_file() and other:
        return
    if not stored.is_file() or not made.is_file():
        check.fail(name, "is missing" if made.is_file() else "does not follow from the record")
    elif stored.stat().st_size > _MOST_BYTES:
        check.fail(name, "is too large to be compared")
    elif stored.read_bytes() == made.read_bytes():
        check.add([])
    elif stored.suffix == ".json":
        _compare_json(check, name, stored, made, other)
    elif stored.suffix == ".csv":
        check.add(list(_csv(name, stored, made, added_columns=bool(other))))
    elif stored.suffix == ".md" and other:
        check.skip(f"text of vsnbench {other}")
    else:
        check.add(list(_lines(name, stored, made)))


def _compare_json(check: Check, name: str, stored: Path, made: Path, other: str) -> None:
    before, now = parse_json(stored.read_bytes()), json.loads(made.read_bytes())
    if name == ENVIRONMENT:
        before, now = ({**content, MADE_BY: ""} if isinstance(content, dict) else content for content in (before, now))
    findings = []
    for path, given, follows in _different(before, now, "", added_keys=bool(other)):
        if other and isinstance(given, str) and isinstance(follows, str):
            check.skip(f"text of vsnbench {other}")
        else:
            findings.append(finding(f"{name}: {path}", f"{_shown(given)}, and the record gives {_shown(follows)}"))
    check.add(findings)


def _different(before: Any, now: Any, path: str, *, added_keys: bool) -> Iterator[tuple[str, Any, Any]]:
    """Yield every differing value with its place, such as `models[0].total.successes`."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys((*before, *now)):
            if key in before or not added_keys:
                place = f"{path}.{key}" if path else str(key)
                yield from _different(before.get(key, _ABSENT), now.get(key, _ABSENT), place, added_keys=added_keys)
    elif isinstance(before, list) and isinstance(now, list):
        for number, (given, follows) in enumerate(zip_longest(before, now, fillvalue=_ABSENT)):
            yield from _different(given, follows, f"{path}[{number}]", added_keys=added_keys)
    elif not _is_same(before, now):
        yield path, before, now


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


_RENAMED = {"path_length_m": "path_m"}
"""Column of tables of older versions -> its name today."""


def _csv(name: str, stored: Path, made: Path, *, added_columns: bool) -> Iterator[Finding]:
    with stored.open(encoding="utf-8", newline="") as given, made.open(encoding="utf-8", newline="") as expected:
        rows, follows = csv.reader(given), csv.reader(expected)
        columns, known = next(rows, []), next(follows, [])
        if added_columns:
            columns = [_RENAMED.get(column, column) for column in columns]
        if not (added_columns and set(columns) <= set(known)) and columns != known:
            yield finding(f"{name} row 0", "has other columns than the record")
            return
        places = [known.index(column) for column in columns]
        for number, (row, now) in enumerate(zip_longest(rows, follows), start=1):
            if row is None or now is None or len(row) != len(columns):
                yield finding(
                    f"{name} row {number}", "is missing" if row is None else "does not follow from the record"
                )
                continue
            for column, value, expects in zip(columns, row, (now[place] for place in places), strict=True):
                if not _is_same(_number(value), _number(expects)):
                    text = f"{value[:100]!r}, and the record gives {expects[:100]!r}"
                    yield finding(f"{name} row {number}: {column}", text)


def _lines(name: str, stored: Path, made: Path) -> Iterator[Finding]:
    given, expected = (path.read_text(encoding="utf-8", errors="replace").split("\n") for path in (stored, made))
    for number, (line, now) in enumerate(zip_longest(given, expected), start=1):
        if line != now:
            yield finding(f"{name} line {number}", f"{str(line)[:100]!r}, and the record gives {str(now)[:100]!r}")
            return
