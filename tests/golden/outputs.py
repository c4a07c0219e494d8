"""Every output of the commands that read results, for records that never change.

`tests/data/records/golden.tar.xz` holds two records as SQL: `lab`, which was run (five models, two disturbances,
corrected and void verdicts, a second judgement, notes), and `rich`, which was made (real and simulated trials of five
models with several operators and seeds). The other two are a released version's, with images, a bundle and a study.
"""

import contextlib
import hashlib
import io
import json
import os
import re
import shutil
import sqlite3
import sys
import tarfile
import zipfile
from contextlib import closing
from pathlib import Path
from unittest import mock

from tests.web.browser import Browser
from tests.web.results_browser.served_record import entered, served
from vsnbench import __version__
from vsnbench.cli.main import main

DATA = Path(__file__).parent.parent / "data"
RICH = "--results rich"
LAB = "--results lab"
STRESS = "stress --goal chair --starts 1-6 --max-steps 30 --disturb low_light,odometry_drift --severity 3"
COMPARED = "compare vlv_real pirlnav_real forward_real"

COMMANDS = (
    *(f"report {results}" for results in (RICH, LAB, "--results first", "--results release")),
    *(f"report --format {name} {RICH}" for name in ("markdown", "latex", "csv", "json")),
    f"report --format json {LAB}",
    "report --format json --results first",
    f"report --all-tables {RICH}",
    f"report --all-tables {LAB}",
    f"report --reference paper {RICH}",
    "report --only-reference",
    f"{COMPARED} {RICH}",
    *(f"{COMPARED} --format {name} {RICH}" for name in ("markdown", "latex", "json")),
    "compare oracle_undisturbed,_within_60_actions random --results lab",
    f"{STRESS} --model forward,oracle {LAB}",
    f"{STRESS} --model forward,oracle --json {LAB}",
    f"episodes list {RICH}",
    f"episodes list --json {RICH}",
    f"episodes list --json {LAB}",
    *(f"episodes show {number} --steps {LAB}" for number in (1, 3, 4, 43)),
    *(f"episodes show {number} --steps --json {LAB}" for number in (1, 3, 4, 43)),
    f"episodes show 1 --json {RICH}",
    "episodes show 1 --json --results first",
    f"export csv -o steps.csv {LAB}",
    f"export episodes -o episodes.csv {LAB}",
    f"export episodes -o rich.csv {RICH}",
    "export episodes -o first.csv --results first",
    f"export tum -o tum {LAB}",
    f"db status {LAB}",
    "verify release",
    "bundle --campaign 1,2 packed.zip --results release",
    "report --output page --figure success-by-goal --results lab",
    "study report --results release",
    "study report --json --results release",
    "study report --format latex --results release",
    "study status --json --results release",
)
"""Command lines in order; an underscore in a word of `compare` is a blank. Written files belong to the output."""

DAILY = tuple(
    line
    for line in COMMANDS
    if "--output page" not in line
    and not line.startswith("db status")
    and not (line.startswith("stress") and "--json" not in line)
    if not (line.startswith(("compare", "study report", f"report --format markdown {RICH}")) and "--format" in line)
    if line not in (f"report --format latex {RICH}", f"report --all-tables {LAB}", f"report --reference paper {RICH}")
)
"""Without pictures, without second forms of what takes seconds to count, and without the size of the record."""

PAGES = ("episodes.json", "episode-1.json", "episode-3.json")
"""Answers of the results browser, below /data."""


def collect(directory: Path, commands: tuple[str, ...] = COMMANDS) -> dict[str, str]:
    """Return the text of every output by its name. An empty directory is used for the records and the files."""
    environment = {"VSNBENCH_OPERATOR": "Ada", "COLUMNS": "80", "SOURCE_DATE_EPOCH": "1767225600"}
    unpack(directory)
    texts: dict[str, str] = {}
    with contextlib.chdir(directory), mock.patch.dict(os.environ, environment):
        for line in commands:
            known = _files()
            texts[line] = _neutral(run(line), directory)
            texts |= {f"{line}: {name}": _neutral(_text(name), directory) for name in sorted(_files() - known)}
        for results in ("lab", "release"):
            with served(Path(results)) as address:
                browser: Browser = entered(address)
                for page in PAGES:
                    body = browser.ask("GET", f"/data/{page}").body
                    texts[f"browse {results}: {page}"] = _neutral(_indented(body), directory)
    return texts


def unpack(directory: Path) -> None:
    """Write the records `lab`, `rich`, `first` and `release`, the last with its study, and bring them up to date."""
    with tarfile.open(DATA / "records" / "golden.tar.xz") as archive:
        scripts = {name: archive.extractfile(f"{name}.sql") for name in ("lab", "rich")}
        texts = {name: file.read().decode() for name, file in scripts.items() if file is not None}
    texts["first"] = (DATA / "records" / "0001.sql").read_text(encoding="utf-8")
    for name, text in texts.items():
        (directory / name).mkdir()
        with closing(sqlite3.connect(directory / name / "vsnbench.db")) as database:
            database.executescript(text)
    with tarfile.open(DATA / "releases" / "1.0.0.tar.xz") as archive:
        members = [member for member in archive if member.name.startswith("results/") or member.name == "study.yaml"]
        archive.extractall(directory, members, filter="data")
    shutil.move(directory / "results", directory / "release")
    with contextlib.chdir(directory):
        for name in (*texts, "release"):
            run(f"db upgrade --results {name}")


def run(line: str) -> str:
    """Run a command in this process; return its exit code, its output and its messages."""
    words = [word.replace("_", " ") if line.startswith("compare") else word for word in line.split()]
    stdout, stderr, code = io.StringIO(), io.StringIO(), 0
    with (
        mock.patch.object(sys, "argv", ["vsnbench", *words]),
        mock.patch.dict(os.environ),
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return f"exit code {code}\n{stdout.getvalue()}{stderr.getvalue()}"


def _files() -> set[str]:
    """Return the files of the working directory that are not part of a record."""
    return {
        str(path)
        for path in Path().rglob("*")
        if path.is_file() and path.parts[0] not in ("lab", "rich", "first", "release")
    }


def _text(name: str) -> str:
    """Return a written file as text: of an archive the digests of its files, of a picture only that it is there."""
    path = Path(name)
    if path.suffix == ".zip":
        with zipfile.ZipFile(path) as archive:
            return "".join(f"{entry} {_sha256(archive.read(entry))}\n" for entry in sorted(archive.namelist()))
    if path.suffix in (".png", ".pdf", ".svg"):
        return "a picture\n"
    return path.read_text(encoding="utf-8")


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _indented(body: bytes) -> str:
    return json.dumps(json.loads(body), indent=1, ensure_ascii=False) + "\n"


def _neutral(text: str, directory: Path) -> str:
    """Return text without the place and the version of this run, and without embedded pictures."""
    text = text.replace(str(directory), "DIRECTORY").replace(__version__, "VERSION")
    return re.sub(r"(?s)<svg.*?</svg>|data:image/[a-z+]+;base64,[A-Za-z0-9+/=]+", "PICTURE", text)
