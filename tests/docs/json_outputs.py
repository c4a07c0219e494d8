"""Runs every command with --json, in this process, and compares what it prints with the schemas in docs/schemas."""

import contextlib
import functools
import hashlib
import io
import json
import os
import shutil
import sqlite3
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from functools import cache
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from unittest import mock

from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from tests.docs.json_files import write_files
from tests.docs.json_records import write_placed_record, write_rich_record
from tests.docs.pages import ROOT
from tests.results.records_of_a_lab import run as run_trial
from tests.results.records_of_a_lab import stopped
from vsnbench.cli.main import main
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.studies.queries import studies
from vsnbench.results.writing.journal import Journal

SHORT = "--max-steps 2"
GOALS = "run --site goals.yaml --keep none --results goals"
STRESS = "stress --site goals.yaml --model answers:Fragile --results stressed"
STUDY = "--arm oracle --arm random --goal chair --starts 1-6"

QUICK = """
init other
init other --quiet
config show
sites list
sites show apartment
sites show goals.yaml
sites check other/lab.yaml
sites check flawed.yaml
sites check invalid-site.yaml
sites scan room.obj scanned.yaml
sites export apartment --map map.yaml
protocol list
protocol show ros4vsn
protocol show protocol.yaml
protocol check protocol.yaml
protocol check invalid-protocol.yaml
robots list
robots show lola2
robots show robot.yaml
robots show legs.yaml
robots check turtlebot2
robots check robot.yaml
robots check invalid-robot.yaml
models new walker
try answers:Broken --results tried
try oracle --goal bed --starts 3 --results tried
models list
models show oracle
models show pirlnav
models show late:Late
models check random
models fetch pirlnav ADDRESS --sha256 SHA256
doctor
doctor --robot turtlebot2
run --model random --goal chair --starts 1 --max-steps 2
note 1 hello --tag first
episodes list
judge --pending
db status
"""
"""Commands in order that take less than a second each."""

COMMANDS = f"""
{QUICK.partition("models fetch ")[0]}
try forward --starts 1 --results tried
sites draw apartment --output plan.svg
sites render other/lab.yaml --output look.png
sites generate --seed 3
models check pirlnav
models check pirlnav --robot lola2
study check progress.yaml
models fetch pirlnav ADDRESS --sha256 SHA256
doctor
doctor --robot turtlebot2
place --start 3 --robot simulated
place --start 3 --robot simulated --turn
run --model random --goal chair --starts 1 {SHORT}
run --model random,forward --goal chair --starts 1-2 {SHORT} --keep none
run --model oracle-waypoints --goal chair --starts 1
run --model forward --goal bed --starts 1 {SHORT} --rehearse --unattended
run --model answers:Answers --robot simulated:legs.yaml --goal chair --site goals.yaml --starts 3 --max-steps 20
run --model answers:Broken --goal chair --starts 1-4 {SHORT} --results broken
run --model random,late:Late --goal chair --starts 1 {SHORT} --keep none --results broken
run --model random --site flat:0,flat:4 --goal bathtub --starts 1 {SHORT} --keep none --results broken
{GOALS} --model random,forward --goal chair,low-table --starts 1-2 {SHORT}
{GOALS} --model random --goal both --starts 1 {SHORT}
{GOALS} --model random --goal chair --starts 1 --protocol protocol.yaml --max-steps 3
stress --model random --goal chair --starts 1 {SHORT} --disturb latency --severity 1 --results stressed
{STRESS} --goal chair --starts 4-11 --protocol protocol.yaml {SHORT} --disturb low_light,depth_holes --severity 3
run --model oracle-waypoints --goal chair --starts 1 --continuous 0.3 {SHORT} --keep none --results moving
episodes show 1 --steps --results moving
report --results moving
note 1 hello --tag first
episodes list
episodes list --results rich
episodes show 1 --steps
episodes show 1 --results rich
episodes show 7 --steps
episodes show 1 --results placed
episodes show 2 --results placed
episodes show 3 --results goals
episodes show 9 --results goals
episodes list --results goals
judge --pending
judge 5 --distance 3 --yes
judge 1 --second Grace --distance 3
judge 1 --second Grace --retract
judge 3 --void visitor --yes
view 1
export tum -o tum
export csv -o data.csv
export bag 1 -o episode.bag
export mcap -o mcap
export lerobot -o lerobot
export episodes -o all-episodes.csv
export video 1
bundle packed.zip --campaign 1
verify results
verify packed.zip
verify rich
import ros4vsn log --model vlv --results imported
import habitat episodes.json --model vlv --max-steps 500 --success-distance 1 --results imported
report
report --results rich
report --results placed
report --reference paper --results rich
report --output page
report --website website --results rich
compare vlv_real pirlnav_real forward_real --results rich
compare vlv_real pirlnav_real --results rich
compare random_under_short random_under_ros4vsn forward --results goals
report --results goals
db status --results first
db upgrade --results first
db upgrade --results new
episodes list --results first
episodes show 1 --steps --results first
report --results first
db path
db status
db upgrade
db backup backup.db
db restore backup.db
db merge imported
db merge imported --results merged
db merge rich --results merged --without-images
db remove-import 6
db delete --episode 2 --reason test --yes
db delete --campaign 1 --reason test --yes --results goals
study plan progress.yaml --results rich
study new {STUDY}
study check
study plan
study lock
study run --unattended --only-next
study run --unattended
study status
study status study.yaml
study amend --reason more
study unblind --reason done
db merge results --results blind
study status study.yaml --results blind
verify results --quiet
study report
study report --output study-page
"""
"""Commands in order; an underscore in a word of `compare` is a blank."""

GROUPS = {"config", "db", "episodes", "export", "import", "models", "protocol", "robots", "sites", "study"}
"""Commands with subcommands."""
SCHEMAS = ROOT / "docs" / "schemas"
CONTENT = b"weights" * 1000
_VALUES = {"SHA256": hashlib.sha256(CONTENT).hexdigest()}
"""Word of a command -> its value."""
FINDS = {
    "place",
    "doctor",
    "sites check",
    "protocol check",
    "robots check",
    "verify",
    "run",
    "stress",
    "study run",
    "models check",
    "try",
}
"""Commands that exit with 1 for what they find."""


def collect(directory: Path, commands: str = COMMANDS) -> dict[str, list[Any]]:
    """Return the JSON outputs of each command, by its name."""
    with _lab(directory):
        outputs: dict[str, list[Any]] = {}
        for line in filter(None, commands.splitlines()):
            prepare = BEFORE.get(line)
            if prepare is not None:
                prepare()
            name, value = run(line)
            outputs.setdefault(name, []).append(value)
        headline = Path("website", "headline.json")
        if headline.is_file():
            outputs["headline"] = [json.loads(headline.read_text(encoding="utf-8"))]
    return outputs


def _run_most_trials() -> None:
    """Write results for all trials of the study but the first and the last: only the oracle succeeds."""
    with Journal.open(sqlite_url(Path("results", "vsnbench.db"))) as journal:
        (study,) = studies(journal.engine)
        for trial in journal.study_progress(study.id)[1:11]:
            run_trial(journal, trial.trial, stopped(success=trial.arm == "oracle"), steps=1)


def _copy_blind_results() -> None:
    shutil.copytree("results", "blind")


def _change_record() -> None:
    with closing(sqlite3.connect(Path("blind", "vsnbench.db"))) as database, database:
        database.execute("UPDATE study SET schedule_sha256 = 'other'")


def _change_image() -> None:
    image = min(Path("results", "episodes").rglob("*.jpg"))
    image.write_bytes(image.read_bytes()[:-9])


def _change_study() -> None:
    file = Path("study.yaml")
    file.write_text(file.read_text(encoding="utf-8").replace("power: 0.8", "power: 0.9"), encoding="utf-8")


BEFORE = {
    "study run --unattended": _run_most_trials,
    "study status study.yaml": _change_study,
    "study unblind --reason done": _copy_blind_results,
    "study status study.yaml --results blind": _change_record,
    "verify results --quiet": _change_image,
}
"""Command -> what happens before it."""


def faults(schema: str, value: Any) -> list[str]:
    """Return how an output differs from a schema, undocumented keys included."""
    validator = Draft202012Validator({"$ref": f"{schema}.json"}, registry=registry())
    return [f"{error.json_path}: {error.message[:300]}" for error in validator.iter_errors(value)]


@cache
def registry() -> "Registry[Any]":
    """Return the schemas by file name, each allowing only the keys that it names."""
    files = [(path.name, json.loads(path.read_text(encoding="utf-8"))) for path in SCHEMAS.glob("*.json")]
    return Registry().with_resources((name, Resource.from_contents(_closed(schema))) for name, schema in files)


def _closed(schema: Any) -> Any:
    """Return a schema that allows only the keys that it names; the published ones allow more for later versions."""
    if isinstance(schema, list):
        return [_closed(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {key: _closed(part) for key, part in schema.items()}
    return {"additionalProperties": False, **closed} if isinstance(closed.get("properties"), dict) else closed


def name_of(line: str) -> str:
    """Return the command of a command line: a word, or two with a subcommand."""
    verb, *rest = line.split()
    return f"{verb} {rest[0]}" if verb in GROUPS else verb


def run(line: str) -> tuple[str, Any]:
    """Run a command with --json; return its name and its output."""
    words = [word.replace("_", " ") if line.startswith("compare") else word for word in line.split()]
    words = [_VALUES.get(word, word) for word in words]
    name = name_of(line)
    stdout, stderr, code = io.StringIO(), io.StringIO(), 0
    with (
        mock.patch.object(sys, "argv", ["vsnbench", *words, "--json"]),
        mock.patch.dict(os.environ),
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    assert code == 0 or (code == 1 and name in FINDS and stdout.getvalue()), f"{line}: {code}, {stderr.getvalue()}"
    return name, json.loads(stdout.getvalue())


@contextmanager
def _lab(directory: Path) -> Iterator[None]:
    """Make the files that the commands need, and work in their directory."""
    environment: Mapping[str, str] = {
        "VSNBENCH_RESULTS": "results",
        "VSNBENCH_WEIGHTS": str(directory / "weights"),
        "VSNBENCH_OPERATOR": "Ada",
    }
    write_files(directory)
    write_rich_record(directory / "rich")
    write_placed_record(directory / "placed")
    (directory / "first").mkdir()
    with closing(sqlite3.connect(directory / "first" / "vsnbench.db")) as database:
        database.executescript((ROOT / "tests/data/records/0001.sql").read_text(encoding="utf-8"))
    with _served(directory), contextlib.chdir(directory), mock.patch.dict(os.environ, environment):
        yield


@contextmanager
def _served(directory: Path) -> Iterator[None]:
    """Serve a file to `models fetch`."""
    (directory / "served").mkdir()
    (directory / "served" / "file").write_bytes(CONTENT)
    handler = functools.partial(_Handler, directory=str(directory / "served"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        _VALUES["ADDRESS"] = f"http://127.0.0.1:{server.server_port}/file"
        try:
            yield
        finally:
            server.shutdown()
            thread.join()


class _Handler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Print nothing."""
