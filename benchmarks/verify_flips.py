"""Counts the random damages of a bundle that `vsnbench verify` finds and names.

    python benchmarks/verify_flips.py [--bytes 100] [--cells 100] [--forged 100] [--seed 0]

Runs, bundles and verifies a study of two arms with 60 simulated trials each. It then verifies the bundle with one
damage at a time, and counts the damages that are found, and those whose file or cell is named:

- bytes: a byte of the archive changes, in a file of each kind in turn, or in the archive's own structure;
- cells: a cell of the bundle's database changes, in each table in turn;
- forged: a cell changes, and all hashes, tables and reports are recomputed. Only checks against other rows and files
  can find such a change; the signature of the manifest protects against it.

Takes about 30 minutes on two cores.
"""

import argparse
import random
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from vsnbench.errors import VsnbenchError  # noqa: E402
from vsnbench.evidence.bundle.archive import MANIFEST, manifest_lines, open_bundle  # noqa: E402 - found from any directory now
from vsnbench.evidence.bundle.derived_files import STUDY_FILE, write_derived_files  # noqa: E402
from vsnbench.evidence.verification.checks import Verification  # noqa: E402
from vsnbench.evidence.verification.verify import VerifyOptions, verify  # noqa: E402
from vsnbench.study.lock import read_note  # noqa: E402

DATABASE = "results/vsnbench.db"


@dataclass
class Outcome:
    """Whether verification found a damage, and named its place."""

    found: bool
    named: bool


def vsnbench(*words: str, at: Path) -> None:
    """Run a vsnbench command in a separate process."""
    command = [sys.executable, "-m", "vsnbench", *words, "--quiet"]
    subprocess.run(command, cwd=at, check=True, env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"})


def make_bundle(at: Path) -> Path:
    """Run a study of two arms with 60 trials each, and bundle it."""
    robot = "simulated:turtlebot2@64x48"
    arms = ("--arm", "oracle", "--arm", "random", "--goal", "chair,bed,sofa,plant")
    vsnbench("study", "new", *arms, "--robot", robot, "--title", "Two baselines", "--question", "Which?", at=at)
    vsnbench("study", "lock", at=at)
    vsnbench("study", "run", at=at)
    vsnbench("study", "unblind", "--reason", "all trials are done", at=at)
    vsnbench("bundle", "--study", "study.yaml", "study.zip", at=at)
    return at / "study.zip"


def verified(path: Path, replay: int = 0) -> Verification | VsnbenchError:
    """Verify a bundle; return the checks or the error."""
    try:
        return verify(path, lambda _what, _done, _of: None, VerifyOptions(replay=replay))
    except VsnbenchError as error:
        return error


def outcome(result: Verification | VsnbenchError, *names: str) -> Outcome:
    """Return whether a damage was found, and whether a single finding contains all names."""
    if isinstance(result, VsnbenchError):
        return Outcome(found=True, named=any(name in str(result) for name in names))
    lines = [finding.where for check in result.checks for finding in check.findings]
    return Outcome(not result.holds, any(all(name in line for name in names) for line in lines))


def flip_bytes(bundle: Path, damages: int, chance: random.Random) -> dict[str, list[Outcome]]:
    """Flip a byte in a file of each kind in turn."""
    kinds: dict[str, list[zipfile.ZipInfo]] = {}
    with zipfile.ZipFile(bundle) as archive:
        for info in archive.infolist():
            path = Path(info.filename)
            kinds.setdefault(path.name if len(path.parts) < 3 else path.suffix, []).append(info)
        end = archive.start_dir
    content, found = bundle.read_bytes(), {}
    names = [*sorted(kinds), "archive structure"]
    for number in range(damages):
        kind = names[number % len(names)]
        if kind == "archive structure":
            place, name = chance.randrange(end, len(content)), ""
        else:
            info = chance.choice(kinds[kind])
            header = content[info.header_offset + 26 : info.header_offset + 30]
            begin = (
                info.header_offset + 30 + int.from_bytes(header[:2], "little") + int.from_bytes(header[2:], "little")
            )
            place, name = begin + chance.randrange(info.file_size), info.filename
        with bundle.open("r+b") as file:
            file.seek(place)
            file.write(bytes([content[place] ^ chance.randrange(1, 256)]))
        result = outcome(verified(bundle), name or "archive")
        found.setdefault(kind, []).append(result)
        print(f"\r{number + 1}", end="", file=sys.stderr, flush=True)
        if not (result.found and result.named):
            print(f"  byte {place} of {name or kind}: {result}")
        with bundle.open("r+b") as file:
            file.seek(place)
            file.write(content[place : place + 1])
    return found


def change_cells(directory: Path, damages: int, chance: random.Random, *, forge: bool) -> dict[str, list[Outcome]]:
    """Change a cell of each table in turn."""
    database, found = directory / DATABASE, {}
    intact = {
        path: path.read_bytes()
        for path in directory.rglob("*")
        if path.is_file() and path.suffix not in (".jpg", ".png")
    }
    with closing(sqlite3.connect(database)) as connection:
        names = [
            name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")
        ]
        tables = [name for name in names if connection.execute(f"SELECT 1 FROM {name}").fetchone()]
    for number in range(damages):
        table = tables[number % len(tables)]
        key, column, before, after = change_cell(database, table, chance)
        if forge:
            make_hashes(directory)
        result = outcome(verified(directory), *((column,) if forge else (DATABASE,)))
        found.setdefault(table, []).append(result)
        print(f"\r{number + 1}", end="", file=sys.stderr, flush=True)
        if not (result.found and result.named) and not forge:
            print(f"  {table} {key} {column}: {before!r} -> {after!r}: {result}")
        for path, content in intact.items():
            if path == database or forge:
                path.write_bytes(content)
    return found


def change_cell(database: Path, table: str, chance: random.Random) -> tuple[str, str, Any, Any]:
    """Change a random cell; return its row's key, its column, and the values before and after."""
    with closing(sqlite3.connect(database)) as connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        columns = connection.execute(f"SELECT name, pk FROM pragma_table_info('{table}')").fetchall()
        keys = [name for name, place in sorted(columns, key=lambda column: column[1]) if place] or [columns[0][0]]
        (count,) = connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()
        while True:
            column, row = chance.choice(columns)[0], chance.randrange(count)
            query = f"SELECT {', '.join(keys)}, {column} FROM {table} ORDER BY {', '.join(keys)} LIMIT 1 OFFSET {row}"
            *key, before = connection.execute(query.replace(f", {column} FROM", f', "{column}" FROM')).fetchone()
            after = changed(before, chance)
            where = " AND ".join(f"{name} = ?" for name in keys)
            try:
                connection.execute(f'UPDATE {table} SET "{column}" = ? WHERE {where}', [after, *key])
            except sqlite3.IntegrityError:  # another row has the value, or it must not be NULL
                connection.rollback()
                continue
            connection.commit()
            return "/".join(map(str, key)), column, before, after


def changed(value: Any, chance: random.Random) -> Any:
    """Return a different value of the same type."""
    match value:
        case None:
            return chance.choice([1, 0.5, "x"])
        case int():
            return 1 - value if value in (0, 1) else value + chance.choice([-1, 1])
        case float():
            return value + chance.choice([-1, 1]) * (0.001 + abs(value) * 0.01)
        case str() if value:
            place = chance.randrange(len(value))
            other = chance.choice([letter for letter in "abcdef0123456789" if letter != value[place]])
            return value[:place] + other + value[place + 1 :]
        case _:
            return "x"


def make_hashes(directory: Path) -> None:
    """Recompute tables, report and manifest, as far as the changed record allows."""
    try:
        write_derived_files(directory / "results", directory, read_note(directory / STUDY_FILE))
    except Exception as error:  # the record is unreadable: keep the old files
        print(f"  not recomputed: {error}"[:120])
    with tempfile.TemporaryDirectory() as none:
        opened = open_bundle(directory, Path(none) / "none")
    import hashlib

    hashes = {
        name: hashlib.sha256((directory / name).read_bytes()).hexdigest()
        for name in opened.files
        if (directory / name).is_file()
    }
    (directory / MANIFEST).write_text(manifest_lines(sorted(hashes.items())))


def show(title: str, found: dict[str, list[Outcome]]) -> None:
    """Print the counts of damages as a table."""
    print(f"\n{title}\n{'where':36}{'damages':>8}{'found':>8}{'named':>8}")
    total: Counter[str] = Counter()
    for kind, outcomes in sorted(found.items()):
        counts = {
            "damages": len(outcomes),
            "found": sum(o.found for o in outcomes),
            "named": sum(o.named for o in outcomes),
        }
        total.update(counts)
        print(f"{kind:36}{counts['damages']:8}{counts['found']:8}{counts['named']:8}")
    print(f"{'all':36}{total['damages']:8}{total['found']:8}{total['named']:8}", flush=True)


def main() -> None:
    """Run the study, verify it with each damage, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for kind in ("bytes", "cells", "forged"):
        parser.add_argument(f"--{kind}", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    chance = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as scratch:
        at = Path(scratch)
        began = time.monotonic()
        bundle = make_bundle(at)
        print(f"bundle of {bundle.stat().st_size / 1e6:.1f} MB in {time.monotonic() - began:.0f} s")
        began = time.monotonic()
        result = verified(bundle, replay=20)
        holds = result.holds if isinstance(result, Verification) else result
        print(f"verified in {time.monotonic() - began:.1f} s, 20 episodes replayed: {holds}")
        if isinstance(result, Verification):
            print(
                *(f"  {check.name}: {check.checked} {check.unit}, {check.failed} failed" for check in result.checks),
                sep="\n",
                flush=True,
            )
        show("changed byte", flip_bytes(bundle, options.bytes, chance))
        opened = open_bundle(bundle, at / "unpacked")
        show(
            "changed cell",
            change_cells(opened.directory, options.cells, chance, forge=False),
        )
        show(
            "changed cell with all hashes recomputed",
            change_cells(opened.directory, options.forged, chance, forge=True),
        )


if __name__ == "__main__":
    main()
