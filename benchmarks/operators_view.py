"""Everything that an operator can see of a study, gathered while it is run, and what of it names a model.

`study_killed.py` uses it: a terminal of 80 columns that is recorded byte for byte, the live Rerun stream as any viewer
gets it over gRPC, the titles of the processes, the verbs that list and report, and every file but the database.
"""

import contextlib
import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import psutil
from rerun.chunk import RrdReader

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.support.live_stream import save_live_stream

VSNBENCH = (sys.executable, "-m", "vsnbench.cli.main")
SHORT = 8
"""Shorter words are looked for in text alone: between compressed pixels and words they stand by chance, or in parts."""
NOT_A_MODEL = re.compile(rb"move[_ ]forward|forward_m(?![a-z])", re.IGNORECASE)
"""An action and a parameter of the protocol have the name of a model; they are there whoever drives."""


class Terminal:
    """A command in a terminal of 80 columns; what it shows is kept, as `script` keeps it."""

    def __init__(self, words: Iterable[str], typescript: Path) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.process = subprocess.Popen(
            [*VSNBENCH, *words], stdin=slave, stdout=slave, stderr=slave, start_new_session=True
        )
        os.close(slave)
        self._typescript = typescript
        self._reader = threading.Thread(target=self._record, daemon=True)
        self._reader.start()

    def _record(self) -> None:
        with self._typescript.open("wb", buffering=0) as file, contextlib.suppress(OSError):
            while shown := os.read(self._master, 65536):
                file.write(shown)

    @property
    def shown(self) -> str:
        """What has been shown until now."""
        return self._typescript.read_text(errors="replace") if self._typescript.exists() else ""

    def titles(self) -> set[str]:
        """Return how `ps` shows this command, its threads and its children now."""
        found: set[str] = set()
        with contextlib.suppress(psutil.Error, OSError):
            own = psutil.Process(self.process.pid)
            for one in (own, *own.children(recursive=True)):
                found |= {" ".join(one.cmdline()), one.name()}
                found |= {name.read_text() for name in Path(f"/proc/{one.pid}/task").glob("*/comm")}
        return found

    def ended(self) -> int:
        """Wait for its end and return its exit code."""
        code = self.process.wait()
        self._reader.join(10)
        os.close(self._master)
        return code


class LiveStream:
    """A second viewer of the live stream, which keeps what it is sent."""

    def __init__(self, terminal: Terminal, file: Path) -> None:
        self.file = file
        self._terminal = terminal
        self._process: subprocess.Popen[bytes] | None = None

    def poll(self) -> None:
        """Begin as soon as the command says where it is shown."""
        address = re.search(r"watch live at (http://\S+)", self._terminal.shown)
        if self._process is not None or address is None:
            return
        with contextlib.suppress(OSError):
            self._process = save_live_stream(address[1], self.file)

    def ended(self) -> None:
        """Stop keeping."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait(30)


def call(*words: str) -> "subprocess.CompletedProcess[bytes]":
    """Call a verb and return what it prints."""
    return subprocess.run([*VSNBENCH, *words], capture_output=True, check=False)


def verbs(episodes: Iterable[int]) -> Iterator[tuple[str, ...]]:
    """Yield every command by which an operator looks at a study and its record."""
    for form in ("table", "markdown", "latex", "html", "json"):
        yield "study", "report", "--format", form
    yield from (("study", "status"), ("study", "report", "--output", "seen/study"))
    for form in ("table", "markdown", "latex", "csv", "json"):
        yield "report", "--all-tables", "--format", form
    yield from (
        ("report", "--output", "seen/page"),
        ("episodes", "list", "--limit", "0"),
        ("episodes", "list", "--json"),
    )
    for number in episodes:
        yield "episodes", "show", str(number)
        yield "episodes", "show", str(number), "--steps"
        yield "episodes", "show", str(number), "--json"
    yield from (("judge", "--pending"), ("export", "csv", "seen/steps.csv"))
    yield from (("export", "habitat", "seen/habitat"), ("export", "tum", "seen/tum"))


def files_below(*tops: str) -> Iterator[Path]:
    """Yield the files that lie there but the database, which keeps the truth."""
    for top in tops:
        yield from (one for one in Path(top).rglob("*") if one.is_file() and not one.name.startswith("vsnbench.db"))


def text_of(recording: Path) -> str:
    """Return all text in a Rerun recording: who it is, its layout, entities, and every value that is no number."""
    reader = RrdReader(recording)
    told = [str(one) for one in (*reader.recordings(), *reader.blueprints())]
    for store in (*reader.recordings(), *reader.blueprints()):
        for chunk in reader.stream(store=store).to_chunks():
            batch = chunk.to_record_batch()
            told += [chunk.entity_path, str(batch.schema.metadata), *batch.schema.names]
            for name in batch.schema.names:
                if "string" in str(batch.schema.field(name).type):
                    told += map(str, batch.column(name).to_pylist())
    return "\n".join(told)


def naming(telling: Iterable[str], seen: Mapping[str, bytes], files: Iterable[Path]) -> list[tuple[str, str]]:
    """Return where a model is named: the place, and the word.

    Args:
        telling: names, labels and hashes.
        seen: what was printed, by what printed it.
        files: files whose content, and whose own names, are looked through.
    """
    words = sorted(set(telling))
    whole = {word: re.compile(rb"(?<![A-Za-z0-9])" + re.escape(word.encode()) + rb"(?![A-Za-z0-9])") for word in words}

    def found(place: str, content: bytes, shortest: int = 0) -> Iterator[tuple[str, str]]:
        there = [word for word in words if len(word) >= shortest and word.encode() in content]
        content = NOT_A_MODEL.sub(b"", content) if there else b""
        yield from ((place, word) for word in there if whole[word].search(content))

    told = [one for place, content in seen.items() for one in found(place, content)]
    for file in files:
        told += found(f"the name of {file}", str(file).encode())
        binary = file.suffix in (".jpg", ".png", ".rrd")
        told += found(str(file), file.read_bytes(), SHORT if binary else 0)
        if file.suffix == ".rrd":
            told += found(f"the text in {file}", text_of(file).encode())
    return told
