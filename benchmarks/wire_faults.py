"""Measures the reaction of `vsnbench run` to faults of a model server.

usage: python benchmarks/wire_faults.py [WORD]   (only the faults whose name has the word; about ten seconds each)

A scripted server fails in its third answer. For each fault, the script starts `vsnbench run` with a new record, two
trials of four actions and a time limit of 1.5 s per action, and then again with a working server: that run must finish.
The table shows the end reason, the message on the console, and a time in seconds: from the request to the server, or
from its kill or stop, to the end of the episode in the record, which is written after the robot is halted. Faults at
the start must stop the command before the robot moves.
"""

import contextlib
import http.server
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from websockets.sync.server import ServerConnection, serve

from vsnbench.models.remote.vsnbench_policy import pack, unpack

ACT_TIMEOUT_S = 1.5
FAULTY_QUESTION = 4
"""Number of the request with the fault; the reset is request 1."""
CLOSE_FRAME = b"\x88\x02\x03\xe9"
_PATIENCE_S = 180.0


def decision(message: dict[str, Any], **others: Any) -> bytes:
    return pack({"type": "decision", "seq": message["seq"], "action": "TURN_LEFT", "seconds": 0.0, **others})


def _late(connection: ServerConnection, message: dict[str, Any]) -> None:
    time.sleep(2 * ACT_TIMEOUT_S)
    connection.send(decision(message))


def _on_file(connection: ServerConnection, message: dict[str, Any]) -> None:
    while not Path("go_on").exists():
        time.sleep(0.02)
    connection.send(decision(message))


def _twice(connection: ServerConnection, message: dict[str, Any]) -> None:
    connection.send(decision(message))
    connection.send(decision(message))


def _old_one_first(connection: ServerConnection, message: dict[str, Any]) -> None:
    connection.send(decision({"seq": message["seq"] - 1}, action="STOP"))
    connection.send(decision(message))


def _gigabyte(connection: ServerConnection, _message: dict[str, Any]) -> None:
    piece = bytes(1 << 20)
    connection.send(piece for _ in range(1024))


def _slow_close(connection: ServerConnection, _message: dict[str, Any]) -> None:
    connection.socket.sendall(CLOSE_FRAME)
    time.sleep(5)


def _answer(**others: Any) -> Callable[[ServerConnection, dict[str, Any]], None]:
    return lambda connection, message: connection.send(decision(message, **others))


SCRIPTS: dict[str, Callable[[ServerConnection, dict[str, Any]], None]] = {
    "killed in mid-act": _on_file,
    "stopped (SIGSTOP) in mid-act": _on_file,
    "answers after the deadline": _late,
    "answers twice": _twice,
    "an old answer comes first": _old_one_first,
    "an answer to a later question": lambda connection, message: connection.send(decision({"seq": message["seq"] + 1})),
    "NaN for a probability": _answer(probabilities={"STOP": float("nan")}),
    "an action that does not exist": _answer(action="FLY"),
    "an answer of 1 GB": _gigabyte,
    "closes slowly": _slow_close,
    "comes back with other weights": _on_file,
}


def serve_script(fault: str, port: int, weights: str) -> None:
    """Serve a model that turns left, and runs the script of its fault once per directory."""
    card = {"name": "scripted", "goals": ["chair"], "sensors": ["rgb"], "weights_sha256": weights}
    greeting = {"type": "card", "wire": 99 if fault == "another version of the wire" else 2, "card": card}
    if fault == "a card without a name":
        greeting["card"] = {**card, "name": ""}

    def handle(connection: ServerConnection) -> None:
        hello = unpack(connection.recv())
        if fault == "wrong token" and hello["token"] != "the right one":
            connection.send(pack({"type": "error", "code": "token", "message": "wrong token"}))
            return
        connection.send(pack(greeting))
        for content in connection:
            message = unpack(content)
            if message["type"] == "bye":
                return
            if message["type"] == "reset":
                connection.send(pack({"type": "ready", "seq": message["seq"]}))
            elif message["seq"] >= FAULTY_QUESTION and fault in SCRIPTS and not Path("asked").exists():
                Path("asked").write_text(str(time.time()))
                SCRIPTS[fault](connection, message)
            else:
                connection.send(decision(message))

    with serve(handle, "127.0.0.1", port, compression=None, max_size=None) as server:
        server.serve_forever()


@dataclass
class Lab:
    """A working directory, a port, and the servers started there."""

    fault: str
    directory: Path
    port: int
    servers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def serve(self, fault: str = "", weights: str = "ab12") -> None:
        """Start a server and wait until it listens."""
        command = [sys.executable, str(Path(__file__).resolve()), "--serve", fault, str(self.port), weights]
        self.servers.append(subprocess.Popen(command, cwd=self.directory, stderr=subprocess.DEVNULL))
        self.wait_for(self._listens)

    def run(self, url: str = "", goal: str = "chair", **environment: str) -> subprocess.Popen[str]:
        """Start `vsnbench run`."""
        command = [sys.executable, "-m", "vsnbench.cli.main", "run", "--model", url or f"ws://127.0.0.1:{self.port}"]
        command += ["--goal", goal, "--starts", "1-2", "--max-steps", "4"]
        (self.directory / "vsnbench.toml").write_text(f"[models]\nact_timeout_s = {ACT_TIMEOUT_S}\n")
        return subprocess.Popen(
            [*command, "--results", str(self.directory / "results")],
            cwd=self.directory,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), "COLUMNS": "80", **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def end(self, number: int = signal.SIGKILL) -> None:
        """Send a signal to the newest server."""
        self.servers[-1].send_signal(number)
        if number == signal.SIGKILL:
            self.servers.pop().wait()

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Poll until a condition is true.

        Raises:
            TimeoutError: the condition stays false for 180 s.
        """
        give_up = time.monotonic() + _PATIENCE_S
        while not condition():
            if time.monotonic() > give_up:
                raise TimeoutError(f"{self.fault}: no result within {_PATIENCE_S:g} s")
            time.sleep(0.02)

    def first_end(self) -> tuple[str, float] | None:
        """Return the end reason and time of the first void episode, or None."""
        with contextlib.suppress(sqlite3.OperationalError), sqlite3.connect(self._database, timeout=10) as database:
            query = (
                "select end_reason, event.created_at from event join episode on episode.id = episode_id "
                "where kind = end_reason order by event.id limit 1"
            )
            for reason, at in database.execute(query):
                return reason, datetime.fromisoformat(at).replace(tzinfo=UTC).timestamp()
        return None

    @property
    def _database(self) -> Path:
        return self.directory / "results" / "vsnbench.db"

    def _listens(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0


def bring_about(lab: Lab) -> tuple[str, str, str]:
    """Run the command on a server with a fault; return the time, the end reason and the console line."""
    lab.serve(lab.fault)
    running = lab.run()
    lab.wait_for((lab.directory / "asked").exists)
    began = float((lab.directory / "asked").read_text())
    if lab.fault in ("killed in mid-act", "comes back with other weights"):
        began = time.time()
        lab.end()
        lab.serve(weights="cd34" if "weights" in lab.fault else "ab12")
    elif "SIGSTOP" in lab.fault:
        began = time.time()
        lab.end(signal.SIGSTOP)
        lab.wait_for(lambda: lab.first_end() is not None)
        (lab.directory / "go_on").touch()
        lab.end(signal.SIGCONT)
    output = running.communicate(timeout=_PATIENCE_S)[0]
    lab.end()
    end = lab.first_end()
    if end is None:
        return "", "none: the episode continues", last_line(output, "done")
    return f"{end[1] - began:.2f} s", end[0], last_line(output, "another one now" if "weights" in lab.fault else "void")


def refused(lab: Lab) -> tuple[str, str, str]:
    """Run the command on an unusable server; it must not write results."""
    with contextlib.ExitStack() as stack:
        words: dict[str, str] = {}
        if lab.fault == "a port that speaks HTTP":
            stack.enter_context(_web_server(lab.port))
        elif lab.fault == "ws:// to another machine without a token":
            words = {"url": "ws://gpu-box:8765", "VSNBENCH_TOKEN": ""}
        elif lab.fault == "a model that does not know the goal":
            lab.serve()
            words = {"goal": "sofa"}
        elif lab.fault != "no server":
            lab.serve(lab.fault)
        began = time.monotonic()
        running = lab.run(**words)
        output = running.communicate(timeout=_PATIENCE_S)[0]
        took_s = time.monotonic() - began
    if lab.servers:
        lab.end()
    if running.returncode == 0 or (lab.directory / "results").exists():
        raise AssertionError(f"{lab.fault}: the run started: {output}")
    return f"{took_s:.1f} s in total", "refused", last_line(output, "error:")


REFUSED = (
    *("no server", "wrong token", "another version of the wire", "a port that speaks HTTP", "a card without a name"),
    *("ws:// to another machine without a token", "a model that does not know the goal"),
)


def last_line(output: str, word: str) -> str:
    lines = [line.strip() for line in output.splitlines() if word in line]
    return lines[0] if lines else f"(no line contains {word}) {output.strip()[-300:]}"


@contextlib.contextmanager
def _web_server(port: int) -> Iterator[None]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", port), http.server.BaseHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield
        server.shutdown()


def main() -> None:
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    print("| server fault | time until the robot stops | end | console message | same command afterwards |")
    print("| --- | --- | --- | --- | --- |")
    for fault in (*SCRIPTS, *REFUSED):
        if word not in fault:
            continue
        with tempfile.TemporaryDirectory() as directory, socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
            probe.close()
            lab = Lab(fault, Path(directory), port)
            try:
                seen = bring_about(lab) if fault in SCRIPTS else refused(lab)
                lab.serve()
                again = lab.run()
                output = again.communicate(timeout=_PATIENCE_S)[0]
            finally:
                for server in lab.servers:
                    server.kill()
                    server.wait()
            then = "finishes" if again.returncode == 0 else f"exit code {again.returncode}: {output[-300:]}"
        line = seen[2].replace(f"127.0.0.1:{port}", "gpu-box:8765").replace("|", "/")
        print(
            f"| {fault} | {seen[0]} | {seen[1].replace('model_', '`model_', 1)}{'`' if '_' in seen[1] else ''} "
            f"| {line} | {then} |",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve_script(sys.argv[2], int(sys.argv[3]), sys.argv[4])
    else:
        main()
