"""Cores, memory and processor that this process may use, within the limits of a container or a batch system."""

import math
import os
import platform
from pathlib import Path

_CGROUP = Path("/sys/fs/cgroup")


def granted_cores() -> int:
    """Return the number of cores, by this process's affinity and its container's quota."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota, _, period = _read(_CGROUP / "cpu.max").partition(" ")
    return min(cores, max(1, math.ceil(float(quota) / float(period)))) if quota.isdecimal() else cores


def total_memory() -> int:
    """Return the bytes of memory."""
    import psutil

    limit = _read(_CGROUP / "memory.max").strip()
    return min(psutil.virtual_memory().total, int(limit)) if limit.isdecimal() else psutil.virtual_memory().total


def available_memory() -> int:
    """Return the bytes of free memory."""
    import psutil

    free = psutil.virtual_memory().available
    limit, used = (_read(_CGROUP / f"memory.{name}").strip() for name in ("max", "current"))
    return min(free, max(int(limit) - int(used), 0)) if limit.isdecimal() and used.isdecimal() else free


def processor() -> str:
    """Return the model of the processor."""
    models = (
        line.partition(":")[2].strip()
        for line in _read(Path("/proc/cpuinfo")).splitlines()
        if line.startswith("model name")
    )
    return next(models, platform.processor())


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
