"""What the processes of a soak hold, sampled into a CSV file, and tables of such a file."""

import csv
import os
import statistics
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import psutil

HALF_HOUR_S = 1800.0
MIB = 2**20


@dataclass(frozen=True, slots=True)
class Sample:
    """A process at a moment."""

    at_s: float
    """Time since the start of the soak."""
    name: str
    pid: int
    rss_mib: float
    threads: int
    handles: int
    """Open file descriptors."""
    connections: int
    """TCP connections to the database server."""


def samples_of(roots: Mapping[str, int], database_port: int, at_s: float) -> Iterator[Sample]:
    """Yield a sample of each command and of its children.

    Args:
        roots: process ID of each command, by name.
        database_port: of the database server.
        at_s: time since the start of the soak.
    """
    for name, root in roots.items():
        for role, process in family(root):
            try:
                with process.oneshot():
                    to_database = [one for one in process.net_connections("tcp") if one.raddr]
                    yield Sample(
                        round(at_s, 1),
                        f"{name}{role}",
                        process.pid,
                        round(process.memory_info().rss / MIB, 2),
                        process.num_threads(),
                        process.num_fds(),
                        sum(one.raddr.port == database_port for one in to_database),
                    )
            except psutil.Error:
                continue  # it has just ended


def family(root: int) -> list[tuple[str, psutil.Process]]:
    """Return a command and its children, with the role of each in the command."""
    try:
        own = psutil.Process(root)
        found = [("", own)]
        for child in own.children(recursive=True):
            words = " ".join(child.cmdline())
            if "fork_server" in words:
                parent = child.parent()
                is_worker = parent is not None and "fork_server" in " ".join(parent.cmdline())
                role = ", worker" if is_worker else ", fork server"
            elif "rerun" in words and "vsnbench_policy" not in words:
                role = ", Rerun"
            else:
                role = ", model process"
            found.append((role, child))
    except psutil.Error:
        return []
    workers = sorted((child.pid for role, child in found if role == ", worker"))
    return [(f"{role} {workers.index(child.pid) + 1}" if role == ", worker" else role, child) for role, child in found]


class SampleFile:
    """A CSV file of samples that is complete after each of them."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", newline="")
        self._writer = csv.writer(self._file)
        self._writer.writerow([field.name for field in fields(Sample)])

    def add(self, samples: Iterator[Sample]) -> None:
        """Append samples."""
        self._writer.writerows(map(astuple, samples))
        self._file.flush()


def read_samples(path: Path) -> list[Sample]:
    """Return the samples of a file."""
    with path.open(newline="") as file:
        return [
            Sample(
                float(row["at_s"]),
                row["name"],
                int(row["pid"]),
                float(row["rss_mib"]),
                int(row["threads"]),
                int(row["handles"]),
                int(row["connections"]),
            )
            for row in csv.DictReader(file)
        ]


def table(samples: list[Sample], warm_up_s: float) -> Iterator[str]:
    """Yield a Markdown table: RSS by half hours, its slope after the warm-up, and ranges of what is counted.

    Args:
        samples: of all processes.
        warm_up_s: samples before that are not part of slopes and ranges.
    """
    last_s = max(sample.at_s for sample in samples)
    halves = range(int(last_s // HALF_HOUR_S) + (last_s % HALF_HOUR_S > HALF_HOUR_S / 4))
    by_name: dict[str, list[Sample]] = defaultdict(list)
    for sample in samples:
        by_name[sample.name].append(sample)
    heads = " | ".join(f"MiB, half hour {half + 1}" for half in halves)
    yield f"| process | {heads} | MiB/h after {warm_up_s / 60:.0f} min | threads | handles | connections | processes |"
    yield "| --- |" + " ---: |" * (len(halves) + 5)
    for name, own in by_name.items():
        warm = [sample for sample in own if sample.at_s >= warm_up_s]
        cells = [_median([s.rss_mib for s in own if s.at_s // HALF_HOUR_S == half]) for half in halves]
        cells += [slope_per_hour([(s.at_s, s.rss_mib) for s in warm])]
        cells += [_range([s.threads for s in warm]), _range([s.handles for s in warm])]
        cells += [_range([s.connections for s in warm]), str(len({s.pid for s in own}))]
        yield f"| {name} | {' | '.join(cells)} |"


def slope_per_hour(points: list[tuple[float, float]]) -> str:
    """Return the slope of a line through points of (seconds, value), per hour; empty for less than three."""
    if len(points) < 3:
        return ""
    return f"{3600 * statistics.linear_regression(*zip(*points, strict=True)).slope:+.1f}"


def _median(values: list[float]) -> str:
    return f"{statistics.median(values):.0f}" if values else ""


def _range(values: list[int]) -> str:
    if not values:
        return ""
    low, high = min(values), max(values)
    return str(low) if low == high else f"{low} to {high}"


def bytes_below(folder: Path) -> int:
    """Return the size of all files below a folder, in bytes on disk."""
    total = 0
    for entry in os.scandir(folder):
        try:
            if entry.is_dir(follow_symlinks=False):
                total += bytes_below(Path(entry.path))
            else:
                total += entry.stat(follow_symlinks=False).st_blocks * 512
        except FileNotFoundError:  # a temporary file that was just renamed
            continue
    return total
