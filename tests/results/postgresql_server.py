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

from sqlalchemy import create_engine, text


@contextmanager
def running_server() -> Iterator[str]:
    """Yield the URL of a server without the name of a database."""
    binaries = _binaries()
    folder = Path(tempfile.mkdtemp(prefix="vsnbench-pg-", dir="/tmp"))
    user = _server_user()
    if user:
        os.chown(folder, user.pw_uid, user.pw_gid)

    def call(program: str, *words: str) -> None:
        identity = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []} if user else {}
        done = subprocess.run(
            [binaries / program, *words], cwd=folder, capture_output=True, text=True, timeout=60, **identity
        )
        assert done.returncode == 0, f"{program}: {done.stdout}{done.stderr}"

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    data, log = str(folder / "data"), str(folder / "log")
    call("initdb", "-D", data, "-U", "lab", "--auth=trust", "--encoding=UTF8", "--no-sync")
    options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder} -c fsync=off"
    try:
        call("pg_ctl", "-D", data, "-l", log, "-o", options, "-w", "start")
        yield f"postgresql+psycopg://lab@127.0.0.1:{port}"
    finally:
        call("pg_ctl", "-D", data, "-m", "immediate", "-w", "stop")
        shutil.rmtree(folder)


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
