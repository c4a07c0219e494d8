"""Checks of this machine and of the results directory."""

from collections.abc import Iterator
from pathlib import Path

from vsnbench.errors import VsnbenchError
from vsnbench.files.disk_speed import write_speed
from vsnbench.installation import command_to_add
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.results.writing.journal import Journal
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.runtime.machine import Extra, MachineFacts

EPISODE_BYTES = 40 * 2**20
_FULL_CAMPAIGN = 90
_LEAST_MEMORY = 2**30
"""A trial of pirlnav takes 0.6 GiB."""
_LEAST_BYTES_PER_S = 20 * 10**6
_TESTED_SYSTEM, _TESTED_PROCESSOR = "Linux", "x86_64"


def check_installation(facts: MachineFacts) -> Iterator[CheckResult]:
    """Check versions and resources, and what is missing for which task."""
    yield _check_system(facts)
    yield _check_packages(facts)
    yield _check_resources(facts)
    yield _check_gpu(facts)
    yield _check_browser(facts)
    for extra in facts.extras:
        yield _check_extra(extra)
    yield (
        CheckResult("ROS", Health.OK, " and ".join(facts.ros))
        if facts.ros
        else CheckResult("ROS", Health.ABSENT, "not installed for this Python; a robot needs it", "see docs/install.md")
    )


def check_results(results: ResultsDirectory) -> Iterator[CheckResult]:
    """Check the disk of a results directory, and that the record can be written."""
    try:
        results.prepare()
        speed = write_speed(results.path)
    except VsnbenchError as error:
        yield CheckResult(
            "results",
            Health.FAILED,
            error.statement.replace(str(results.path), _shortened(results.path)),
            error.advice or "choose another directory with --results",
        )
        return
    except OSError as error:
        yield CheckResult("results", Health.FAILED, f"cannot write {_shortened(results.path)}: {error.strerror}")
        return
    yield _check_disk(results, speed)
    try:
        with Journal.open(results.database_url):
            pass
    except VsnbenchError as error:
        yield CheckResult("database", Health.FAILED, error.statement, error.advice or "see docs/results.md")
    else:
        label = results.database_label.replace(str(results.path), _shortened(results.path))
        yield CheckResult("database", Health.OK, f"{label} can be written")


def _check_disk(results: ResultsDirectory, bytes_per_s: float) -> CheckResult:
    free = results.free_bytes()
    episodes = free // EPISODE_BYTES
    seen = (
        f"{_shortened(results.path)}: {free / 2**30:.1f} GiB free, room for about {episodes} episodes; "
        f"writes {bytes_per_s / 1e6:.0f} MB/s"
    )
    if episodes < _FULL_CAMPAIGN:
        return CheckResult("disk", Health.WARNING, seen, f"a campaign of {_FULL_CAMPAIGN} episodes may not fit")
    if bytes_per_s < _LEAST_BYTES_PER_S:
        return CheckResult("disk", Health.WARNING, seen, "choose a faster disk with --results, or --keep none")
    return CheckResult("disk", Health.OK, seen)


def _check_system(facts: MachineFacts) -> CheckResult:
    seen = f"{facts.vsnbench}, {facts.python}, {facts.system}, {facts.libc}, {facts.architecture}"
    if facts.kernel.startswith(_TESTED_SYSTEM) and facts.architecture == _TESTED_PROCESSOR:
        return CheckResult("vsnbench", Health.OK, seen)
    return CheckResult("vsnbench", Health.WARNING, seen, f"tested on {_TESTED_SYSTEM}, {_TESTED_PROCESSOR} only")


def _check_packages(facts: MachineFacts) -> CheckResult:
    wrong = [
        f"{package.name} {package.installed or 'missing'} (needs {package.required or 'any version'})"
        for package in facts.packages
        if not package.fits
    ]
    if wrong:
        return CheckResult("packages", Health.FAILED, ", ".join(wrong), "install vsnbench again")
    if not facts.packages:
        return CheckResult("packages", Health.WARNING, "vsnbench runs without being installed", "see docs/install.md")
    return CheckResult("packages", Health.OK, f"{len(facts.packages)} required packages are installed")


def _check_resources(facts: MachineFacts) -> CheckResult:
    seen = (
        f"{facts.cores} cores of {facts.processor or facts.architecture}, {facts.memory_bytes / 2**30:.1f} GiB memory, "
        f"{facts.available_memory_bytes / 2**30:.1f} GiB of it free"
    )
    if facts.available_memory_bytes < _LEAST_MEMORY:
        return CheckResult("machine", Health.WARNING, seen, "end other programs: a trial takes up to 0.6 GiB")
    return CheckResult("machine", Health.OK, seen)


def _check_gpu(facts: MachineFacts) -> CheckResult:
    if not facts.gpus:
        return CheckResult("GPU", Health.ABSENT, "no NVIDIA GPU; models run on the CPU")
    seen = ", ".join(f"{gpu.name}, {gpu.memory_bytes / 2**30:.0f} GiB, driver {gpu.driver}" for gpu in facts.gpus)
    if facts.torch_uses_gpu is False:
        return CheckResult("GPU", Health.WARNING, f"{seen}; PyTorch does not use it", "install PyTorch's CUDA build")
    return CheckResult("GPU", Health.OK, seen)


def _check_browser(facts: MachineFacts) -> CheckResult:
    if facts.browser:
        return CheckResult("browser", Health.OK, facts.browser + ("" if facts.display else "; no display"))
    return CheckResult(
        "browser", Health.ABSENT, "none; browse, report --serve and --console can be opened from another machine"
    )


def _check_extra(extra: Extra) -> CheckResult:
    what = f"extra {extra.name}"
    wrong = [package for package in extra.packages if package.installed and not package.fits]
    if wrong:
        seen = ", ".join(f"{package.name} {package.installed} (needs {package.required})" for package in wrong)
        return CheckResult(what, Health.WARNING, seen, command_to_add(extra.name))
    if extra.installed:
        versions = ", ".join(f"{package.name} {package.installed}" for package in extra.packages)
        return CheckResult(what, Health.OK, versions)
    return CheckResult(what, Health.ABSENT, f"not installed; for {extra.purpose}", command_to_add(extra.name))


def _shortened(path: Path) -> str:
    """Return a path without the name of the user's home."""
    home = Path.home()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) and path != home else str(path)
