"""A PostgreSQL server on loopback in its own folder under /tmp, removed at the end."""

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

import psutil
from sqlalchemy import create_engine, text


class PostgresqlServer:
    """A server that can be killed and started again with the same data."""

    def __init__(self, folder: Path) -> None:
        """Create the data and start the server."""
        self._binaries = _binaries()
        self._user = _server_user()
        if self._user:
            os.chown(folder, self._user.pw_uid, self._user.pw_gid)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        self._folder = folder
        self._data = folder / "data"
        self._call("initdb", "-D", self._data, "-U", "lab", "--auth=trust", "--encoding=UTF8", "--no-sync")
        self.start()

    @property
    def url(self) -> str:
        """URL without the name of a database."""
        return f"postgresql+psycopg://lab@127.0.0.1:{self._port}"

    @property
    def postmaster(self) -> psutil.Process:
        """The server's first process; its children serve the connections."""
        return psutil.Process(int((self._data / "postmaster.pid").read_text().split()[0]))

    def start(self) -> None:
        """Start it, and return when it accepts connections."""
        options = (
            f"-p {self._port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={self._folder} -c fsync=off"
        )
        self._call("pg_ctl", "-D", self._data, "-l", self._folder / "log", "-o", options, "-w", "start")

    def kill(self) -> None:
        """Kill its first process with SIGKILL, and wait for the end of the others."""
        postmaster = self.postmaster
        processes = [postmaster, *postmaster.children(recursive=True)]
        postmaster.kill()
        psutil.wait_procs(processes, 30)

    def stop(self) -> None:
        """Stop it at once."""
        self._call("pg_ctl", "-D", self._data, "-m", "immediate", "-w", "stop")

    def _call(self, program: str, *words: str | Path) -> None:
        user = self._user
        identity = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []} if user else {}
        command = [self._binaries / program, *words]
        done = subprocess.run(command, cwd=self._folder, capture_output=True, text=True, timeout=60, **identity)
        assert done.returncode == 0, f"{program}: {done.stdout}{done.stderr}"


@contextmanager
def killable_server() -> Iterator[PostgresqlServer]:
    """Give a server; stopped and removed at the end."""
    folder = Path(tempfile.mkdtemp(prefix="vsnbench-pg-", dir="/tmp"))
    server = PostgresqlServer(folder)
    try:
        yield server
    finally:
        server.stop()
        shutil.rmtree(folder)


@contextmanager
def running_server() -> Iterator[str]:
    """Give the URL of a server without the name of a database."""
    with killable_server() as server:
        yield server.url


def new_database(server: str) -> str:
    """Return the URL of a fresh, empty database."""
    name = f"test_{uuid4().hex}"
    engine = create_engine(f"{server}/postgres", isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return f"{server}/{name}"


def _binaries() -> Path:
    places = [*sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)]
    if program := shutil.which("initdb"):
        places.append(Path(program).resolve().parent)
    for place in places:
        if (place / "initdb").is_file() and (place / "pg_ctl").is_file():
            return place
    raise RuntimeError("these tests start a PostgreSQL of their own: apt-get install postgresql")


def _server_user() -> pwd.struct_passwd | None:
    """Return the user for PostgreSQL, which refuses to run as root."""
    if os.getuid():
        return None
    names = {entry.pw_name: entry for entry in pwd.getpwall()}
    return names.get("postgres") or names["nobody"]
