"""Description of the writing process, and checks whether a process is alive."""

import getpass
import hashlib
import os
import platform
import re
import socket
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import psutil

from vsnbench import __version__
from vsnbench.results.database_url import command_without_passwords
from vsnbench.runtime.git import checkout_of
from vsnbench.runtime.resources import processor


@dataclass(frozen=True, slots=True)
class ProcessIdentity:
    """Unique identity of a process."""

    host: str
    pid: int
    boot_id: str
    """Boot id of the kernel; empty if unknown."""
    pid_namespace: str
    """PID namespace, because containers number their processes separately."""
    start_ticks: int
    """Start time in kernel ticks since boot; 0 if unknown."""

    def is_alive(self, here: "ProcessIdentity") -> bool | None:
        """Return whether this process is running, seen from the process `here`.

        Returns:
            None if unknown: it ran in another container, on another machine, or before a restart. Host names are not
            sufficient, because robots of one make often share theirs.
        """
        same_kernel = self.boot_id == here.boot_id and (bool(self.boot_id) or self.host == here.host)
        if not same_kernel or self.pid_namespace != here.pid_namespace:
            return None
        if self.start_ticks:
            return _start_ticks(self.pid) == self.start_ticks
        return psutil.pid_exists(self.pid)


@dataclass(frozen=True, slots=True)
class Provenance:
    """A writing process and the environment that its results depend on."""

    identity: ProcessIdentity
    started_at: datetime
    operator: str
    command: str
    vsnbench_version: str
    git_commit: str = ""
    git_dirty: bool = False
    packages: Mapping[str, str] = field(default_factory=dict)
    platform: Mapping[str, Any] = field(default_factory=dict)


def gather_provenance(*, of_run: bool = False) -> Provenance:
    """Describe this process; of one that runs trials also with the hashes of its packages.

    The operator is $VSNBENCH_OPERATOR, else the login name.
    """
    hashes = {"package_hashes": package_hashes()} if of_run else {}
    code = checkout_of(Path(__file__))
    return Provenance(
        identity=this_process(),
        started_at=datetime.now(UTC),
        operator=os.environ.get("VSNBENCH_OPERATOR") or login_name(),
        command=command_without_passwords(sys.argv),
        vsnbench_version=__version__,
        git_commit=code.commit,
        git_dirty=code.dirty,
        packages=_packages(),
        platform={
            "system": platform.platform(),
            "python": platform.python_version(),
            "machine": platform.machine(),
            "processor": processor(),
            **hashes,
        },
    )


def this_process() -> ProcessIdentity:
    """Return the identity of this process; not cached, because a fork is another process."""
    return ProcessIdentity(
        host=socket.gethostname(),
        pid=os.getpid(),
        boot_id=_read(Path("/proc/sys/kernel/random/boot_id")).strip(),
        pid_namespace=_pid_namespace(),
        start_ticks=_start_ticks(os.getpid()),
    )


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _pid_namespace() -> str:
    try:
        return str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        return ""


def _start_ticks(pid: int) -> int:
    """Return field 22 of /proc/PID/stat; 0 if the process does not exist or is a zombie.

    psutil converts this to wall-clock time, which changes when a robot's clock is set.
    """
    _, _, rest = _read(Path(f"/proc/{pid}/stat")).rpartition(")")  # the process name may contain spaces and brackets
    fields = rest.split()
    return int(fields[19]) if len(fields) > 19 and fields[0] != "Z" else 0


def login_name() -> str:
    """Return the login name, the default operator."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # the user of a container may have no name
        return f"uid {os.getuid()}"


@cache
def _packages() -> dict[str, str]:
    found = dict(_name_and_version(package) for package in metadata.distributions())
    return {name: found[name] for name in sorted(found) if name}


_OF_THIS_INSTALLATION = re.compile(
    r"^(?:\.\./|[^,\n]*(?:__pycache__/|\.dist-info/(?:RECORD|INSTALLER|REQUESTED|direct_url\.json),)).*\n?",
    re.MULTILINE,
)
"""Lines of a package's list of files that the installer added."""


@cache
def package_hashes() -> dict[str, str]:
    """Return the SHA-256 of each package's list of files with their hashes, as it is in the wheel, sorted."""
    found = {}
    for package in metadata.distributions():
        name, listed = _name_and_version(package)[0], package.read_text("RECORD")
        if name and listed:
            lines = sorted(_OF_THIS_INSTALLATION.sub("", listed.replace("\r\n", "\n")).splitlines())
            found[name] = hashlib.sha256("\n".join(lines).encode()).hexdigest()
    return {name: found[name] for name in sorted(found)}


def _name_and_version(package: metadata.Distribution) -> tuple[str, str]:
    """Return a package's lower-case name and version; ten times as fast as the mail parser."""
    text = package.read_text("METADATA") or package.read_text("PKG-INFO") or package.read_text("") or ""
    head = dict(line.partition(": ")[::2] for line in text.partition("\n\n")[0].splitlines())
    return head.get("Name", "").strip().lower(), head.get("Version", "").strip()
