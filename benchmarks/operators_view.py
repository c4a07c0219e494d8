"""Collects everything an operator can see of a study, and finds model names in it.

`study_killed.py` uses it. The sources are a terminal of 80 columns recorded byte for byte, the live Rerun stream that
a viewer receives over gRPC, the process titles, the output of the listing and reporting commands, and every file except
the database.
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
MIN_BINARY_LENGTH = 8
"""Minimum length of a name to search for in binary files, where shorter names occur by chance."""
NOT_A_MODEL = re.compile(rb"move[_ ]forward|forward_m(?![a-z])", re.IGNORECASE)
"""An action and a protocol parameter contain the name of the model `forward`; they occur with every model."""


class Terminal:
    """Runs a command in a terminal of 80 columns and records its output, as `script` does."""

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
        """Output so far."""
        return self._typescript.read_text(errors="replace") if self._typescript.exists() else ""

    def titles(self) -> set[str]:
        """Return the current names of the command, its children and their threads, as `ps` lists them."""
        found: set[str] = set()
        with contextlib.suppress(psutil.Error, OSError):
            own = psutil.Process(self.process.pid)
            for process in (own, *own.children(recursive=True)):
                found |= {" ".join(process.cmdline()), process.name()}
                found |= {name.read_text() for name in Path(f"/proc/{process.pid}/task").glob("*/comm")}
        return found

    def ended(self) -> int:
        """Wait for the command to exit and return its exit code."""
        code = self.process.wait()
        self._reader.join(10)
        os.close(self._master)
        return code


class LiveStream:
    """Saves the live stream as a second viewer."""

    def __init__(self, terminal: Terminal, file: Path) -> None:
        self.file = file
        self._terminal = terminal
        self._process: subprocess.Popen[bytes] | None = None

    def poll(self) -> None:
        """Start saving once the command has printed the viewer's address."""
        address = re.search(r"watch live at (http://\S+)", self._terminal.shown)
        if self._process is not None or address is None:
            return
        with contextlib.suppress(OSError):
            self._process = save_live_stream(address[1], self.file)

    def ended(self) -> None:
        """Stop saving."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait(30)


def call(*words: str) -> "subprocess.CompletedProcess[bytes]":
    """Run a vsnbench command and return its output."""
    return subprocess.run([*VSNBENCH, *words], capture_output=True, check=False)


def inspection_commands(episodes: Iterable[int]) -> Iterator[tuple[str, ...]]:
    """Yield every command with which an operator can inspect a study and its record."""
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
    yield from (("judge", "--pending"), ("export", "csv", "-o", "seen/steps.csv"))
    yield from (("export", "tum", "-o", "seen/tum"),)


def files_below(*tops: str) -> Iterator[Path]:
    """Yield all files below some directories except the database, which contains the model names."""
    for top in tops:
        yield from (path for path in Path(top).rglob("*") if path.is_file() and not path.name.startswith("vsnbench.db"))


def text_of(recording: Path) -> str:
    """Return all text in a Rerun recording: its identity, layout, entity paths and string values."""
    reader = RrdReader(recording)
    parts = [str(store) for store in (*reader.recordings(), *reader.blueprints())]
    for store in (*reader.recordings(), *reader.blueprints()):
        for chunk in reader.stream(store=store).to_chunks():
            batch = chunk.to_record_batch()
            parts += [chunk.entity_path, str(batch.schema.metadata), *batch.schema.names]
            for name in batch.schema.names:
                if "string" in str(batch.schema.field(name).type):
                    parts += map(str, batch.column(name).to_pylist())
    return "\n".join(parts)


def find_names(names: Iterable[str], outputs: Mapping[str, bytes], files: Iterable[Path]) -> list[tuple[str, str]]:
    """Return (place, name) of each occurrence of a model's name.

    Args:
        names: names, labels and hashes of the models.
        outputs: output of each command.
        files: files to search, content and path.
    """
    words = sorted(set(names))
    whole = {word: re.compile(rb"(?<![A-Za-z0-9])" + re.escape(word.encode()) + rb"(?![A-Za-z0-9])") for word in words}

    def found(place: str, content: bytes, shortest: int = 0) -> Iterator[tuple[str, str]]:
        there = [word for word in words if len(word) >= shortest and word.encode() in content]
        content = NOT_A_MODEL.sub(b"", content) if there else b""
        yield from ((place, word) for word in there if whole[word].search(content))

    occurrences = [occurrence for place, content in outputs.items() for occurrence in found(place, content)]
    for file in files:
        occurrences += found(f"the name of {file}", str(file).encode())
        binary = file.suffix in (".jpg", ".png", ".rrd")
        occurrences += found(str(file), file.read_bytes(), MIN_BINARY_LENGTH if binary else 0)
        if file.suffix == ".rrd":
            occurrences += found(f"the text in {file}", text_of(file).encode())
    return occurrences
