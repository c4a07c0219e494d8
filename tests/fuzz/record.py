"""Results directories with damaged rows, tables, bytes and files, under every command."""

import random
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from tests.fuzz import mutations
from tests.fuzz.command_line import call
from vsnbench.errors import VsnbenchError

VERBS: tuple[tuple[str, ...], ...] = (
    ("episodes", "list"),
    ("episodes", "list", "--json"),
    ("episodes", "show", "1", "--steps"),
    ("episodes", "show", "1", "--json"),
    ("db", "status"),
    ("db", "status", "--json"),
    ("db", "upgrade"),
    ("db", "backup", "{home}/copy.db"),
    ("report",),
    ("report", "--format", "json"),
    ("report", "--format", "latex"),
    ("report", "--reference", "paper"),
    ("compare", "vlv", "forward"),
    ("export", "csv", "-o", "{home}/steps.csv"),
    ("export", "tum", "-o", "{home}/tum"),
    ("export", "bag", "1", "-o", "{home}/one.bag"),
    ("view", "1", "--path"),
    ("judge", "1", "--confirm", "--yes"),
    ("judge", "1", "--void", "why", "--yes"),
    ("judge", "--pending"),
    ("db", "merge", "{home}/results", "--results", "{home}/merged"),
    ("db", "merge", "{home}/good"),
    ("db", "restore", "{home}/good/vsnbench.db"),
    ("import", "habitat", "-o", "{home}/good.json", "--model", "m", "--max-steps", "150", "--success-distance", "1"),
)


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, i AS number FROM n"


def flip_bits_of_text(rng: random.Random, file: Path) -> None:
    """Flip the highest bits of letters, in rows and in the schema, so that texts are not UTF-8."""
    content = bytearray(file.read_bytes())
    letters = [place for place, byte in enumerate(content[100:], 100) if chr(byte).isalpha() and byte < 0x80]
    for place in rng.sample(letters, rng.choice((1, 3, 30))):
        content[place] ^= 0x80
    file.write_bytes(content)


class RecordTarget:
    """The SQLite database and the files next to it."""

    def __init__(self, home: Path) -> None:
        from tests.viewer.synthetic_episode import record
        from vsnbench.results.files.directory import ResultsDirectory

        self.home, self.good, self.path = home, home / "good", home / "results"
        record(ResultsDirectory.locate(self.good, environment={}), 2)
        with closing(sqlite3.connect(self.good / "vsnbench.db")) as database:
            database.execute("PRAGMA journal_mode = DELETE")
        (home / "good.json").write_text('[{"goal": "bed", "success": 0, "steps": 15}]')

    def load(self, rng: random.Random, index: int | None) -> None:
        for left in ("results", "copy.db", "steps.csv", "tum", "one.bag", "merged"):
            path = self.home / left
            shutil.rmtree(path, ignore_errors=True)
            path.unlink(missing_ok=True)
        shutil.copytree(self.good, self.path)
        if index is None:
            verbs = VERBS
        else:
            self.spoil(rng)
            verbs = tuple(rng.sample(VERBS, 2))
        codes = [
            call(
                *(word.format(home=self.home) for word in verb),
                *([] if "--results" in verb else ["--results", str(self.path)]),
            )
            for verb in verbs
        ]
        if any(codes) and index is not None:
            raise VsnbenchError

    def spoil(self, rng: random.Random) -> None:
        """Make a change that vsnbench never makes."""
        file = self.path / "vsnbench.db"
        kind = rng.random()
        if kind < 0.15:
            file.write_bytes(mutations.bytes_of(rng, file.read_bytes()))
        elif kind < 0.3:
            flip_bits_of_text(rng, file)
        elif kind < 0.34:
            content = bytearray(file.read_bytes())
            for _ in range(rng.choice((1, 3))):
                content[rng.randrange(100)] = rng.randrange(256)
            file.write_bytes(content)
        elif kind < 0.8:
            self.rows(rng, file)
        elif kind < 0.9:
            self.tables(rng, file)
        else:
            self.files(rng)

    def rows(self, rng: random.Random, file: Path) -> None:
        """Write values of the wrong type into rows, without the schema's checks."""
        with closing(sqlite3.connect(file)) as database, database:
            database.execute("PRAGMA ignore_check_constraints = ON")
            for _ in range(rng.choice((1, 1, 2, 4))):
                table = rng.choice(_tables(database))
                columns = [row[1] for row in database.execute(f"PRAGMA table_info('{table}')")]
                made = _cell(rng)
                try:
                    database.execute(f"UPDATE OR IGNORE '{table}' SET \"{rng.choice(columns)}\" = ?", [made])
                except (sqlite3.Error, OverflowError, UnicodeEncodeError):
                    continue

    def tables(self, rng: random.Random, file: Path) -> None:
        """Change the schema."""
        with closing(sqlite3.connect(file)) as database:
            table = rng.choice(_tables(database))
            columns = [row[1] for row in database.execute(f"PRAGMA table_info('{table}')")]
            statement = rng.choice(
                (
                    f"DROP TABLE '{table}'",
                    f"DELETE FROM '{table}'",
                    f"ALTER TABLE '{table}' RENAME TO other",
                    f"ALTER TABLE '{table}' RENAME COLUMN \"{rng.choice(columns)}\" TO other",
                    f"CREATE TRIGGER t AFTER INSERT ON '{table}' BEGIN DELETE FROM '{table}'; END",
                    "UPDATE alembic_version SET version_num = 'x'",
                    "UPDATE alembic_version SET version_num = '0001'",
                    "DELETE FROM alembic_version",
                    "INSERT INTO alembic_version VALUES ('0002x')",
                    "PRAGMA user_version = 77",
                    f"CREATE TABLE copy AS SELECT * FROM '{table}'",
                    f"ALTER TABLE '{table}' RENAME TO old; CREATE VIEW '{table}' AS SELECT * FROM old",
                    f"ALTER TABLE '{table}' RENAME TO old; CREATE VIEW '{table}' AS {ENDLESS}",
                    f"CREATE VIEW v AS {ENDLESS}",
                    f"CREATE TRIGGER t AFTER UPDATE ON '{table}' BEGIN UPDATE episode SET state = 'done'; END",
                    f"CREATE INDEX e ON '{table}' (upper({columns[0]}))",
                    f"ALTER TABLE '{table}' ADD COLUMN c AS (upper({columns[0]}))",
                    "CREATE VIRTUAL TABLE words USING fts5(a)",
                )
            )
            try:
                database.execute("PRAGMA foreign_keys = OFF")
                database.executescript(statement)
            except sqlite3.Error:
                with database:
                    database.execute("DROP TABLE IF EXISTS event")

    def files(self, rng: random.Random) -> None:
        """Damage a file next to the database."""
        folder = self.path / "episodes" / "000001"
        name = rng.choice(("rgb/0001.jpg", "depth/0001.png", "episode.rrd", "trajectory.tum", "../../vsnbench.db-wal"))
        path = folder / name
        if path.exists() and rng.random() < 0.6:
            path.write_bytes(mutations.bytes_of(rng, path.read_bytes()))
        else:
            path.unlink(missing_ok=True)
            match rng.randrange(4):
                case 0:
                    path.mkdir()
                case 1:
                    path.symlink_to("/etc/hostname")
                case 2:
                    path.symlink_to(path)
                case _:
                    path.write_bytes(rng.randbytes(3000))


def _tables(database: sqlite3.Connection) -> list[str]:
    return [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]


def _cell(rng: random.Random) -> Any:
    match rng.randrange(5):
        case 0:
            return rng.choice((None, b"\xff\xfe", b"", 2**63 - 1, -(2**63), 1e308, float("inf"), -1, 0, 3))
        case 1:
            import json

            return json.dumps(mutations.value(rng))
        case 2:
            return rng.choice(('{"a": ', "[" * 100_000, "NaN", "[1e999]", "{}", "[]", "null", '"x"', "3"))
        case _:
            made = rng.choice((*mutations.WORDS, *mutations.NUMBERS))
            return made if not isinstance(made, int) or abs(made) < 2**63 else str(made)
