"""Facts about this machine and installation: versions, extras, cores, memory, GPUs, browser, ROS."""

import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata

from packaging.requirements import Requirement

from vsnbench import __version__
from vsnbench.runtime.resources import available_memory, granted_cores, processor, total_memory
from vsnbench.runtime.ros_version import RosGeneration, has_module

EXTRAS: Mapping[str, str] = {
    "neural": "the model vlv, Mask R-CNN, pirlnav on a GPU",
    "viewer": "vsnbench view, run --live",
    "postgresql": "--db postgresql+psycopg://...",
    "scan": "vsnbench sites scan",
    "bags": "vsnbench export bag, export mcap",
    "video": "vsnbench export video",
    "lerobot": "vsnbench export lerobot",
    "ros2": "a robot on ROS 2 without a ROS installation",
    "ray": "run --workers ray://...",
}
"""Extra -> what needs it. `docs/install.md` has the same table with sizes."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox", "xdg-open")
_PROGRAM_TIMEOUT_S = 10
_GPU_FIELDS = 3


@dataclass(frozen=True, slots=True)
class Package:
    """A package that vsnbench or an extra of it requires."""

    name: str
    required: str
    """Version specifier, such as `>=2.0`."""
    installed: str | None
    """Version; None if it is not installed."""
    fits: bool
    """A version that the specifier allows is installed."""


@dataclass(frozen=True, slots=True)
class Extra:
    """An optional part of vsnbench."""

    name: str
    purpose: str
    installed: bool
    packages: tuple[Package, ...]


@dataclass(frozen=True, slots=True)
class Gpu:
    """An NVIDIA GPU."""

    name: str
    memory_bytes: int
    driver: str


@dataclass(frozen=True, slots=True)
class MachineFacts:
    """What a maintainer needs to know about a machine; no names, no paths, no environment variables."""

    vsnbench: str
    python: str
    system: str
    """Operating system with its version."""
    kernel: str
    architecture: str
    libc: str
    processor: str
    cores: int
    """Number of cores that this process may use."""
    memory_bytes: int
    """The container's limit, if there is one."""
    available_memory_bytes: int
    gpus: tuple[Gpu, ...]
    torch_uses_gpu: bool | None
    """None without a GPU or without PyTorch."""
    browser: str | None
    """Name of a browser's program; None without a browser."""
    display: bool
    """Windows can be opened."""
    ros: tuple[str, ...]
    """Versions of ROS whose Python library is installed."""
    packages: tuple[Package, ...]
    """What vsnbench requires; empty if it runs without being installed."""
    extras: tuple[Extra, ...]


def gather_machine_facts() -> MachineFacts:
    """Describe this machine and installation."""
    requirements = _requirements()
    gpus = _gpus()
    extras = []
    for name, purpose in EXTRAS.items():
        packages = requirements.get(name, ())
        extras.append(Extra(name, purpose, bool(packages) and all(package.installed for package in packages), packages))
    return MachineFacts(
        vsnbench=__version__,
        python=f"{platform.python_implementation()} {platform.python_version()}",
        system=_system(),
        kernel=f"{platform.system()} {platform.release()}",
        architecture=platform.machine(),
        libc=" ".join(platform.libc_ver()).strip() or "unknown",
        processor=processor(),
        cores=granted_cores(),
        memory_bytes=total_memory(),
        available_memory_bytes=available_memory(),
        gpus=gpus,
        torch_uses_gpu=_torch_uses_gpu() if gpus else None,
        browser=next((name for name in BROWSERS if shutil.which(name)), None),
        display=any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")),
        ros=tuple(version.label for version in RosGeneration if has_module(version.value)),
        packages=requirements.get("", ()),
        extras=tuple(extras),
    )


def _system() -> str:
    try:
        return platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        return f"{platform.system()} {platform.release()}"


def _requirements() -> dict[str, tuple[Package, ...]]:
    """Return the required packages of each extra, and of vsnbench itself under an empty name."""
    try:
        lines = metadata.requires("vsnbench") or []
    except metadata.PackageNotFoundError:
        return {}
    found: dict[str, list[Package]] = {}
    for requirement in map(Requirement, lines):
        marker = requirement.marker
        extra = next((name for name in ("", *EXTRAS) if marker is None or marker.evaluate({"extra": name})), None)
        if extra is not None:
            found.setdefault(extra, []).append(_package(requirement))
    return {extra: tuple(packages) for extra, packages in found.items()}


def _package(requirement: Requirement) -> Package:
    try:
        version = metadata.version(requirement.name)
    except metadata.PackageNotFoundError:
        return Package(requirement.name, str(requirement.specifier), None, fits=False)
    fits = requirement.specifier.contains(version, prereleases=True)
    return Package(requirement.name, str(requirement.specifier), version, fits)


def _gpus() -> tuple[Gpu, ...]:
    query = ["nvidia-smi", "--query-gpu=name,memory.total,driver_version", "--format=csv,noheader,nounits"]
    try:
        done = subprocess.run(query, capture_output=True, text=True, timeout=_PROGRAM_TIMEOUT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return ()
    rows = ([field.strip() for field in line.rsplit(",", 2)] for line in done.stdout.splitlines())
    return tuple(
        Gpu(name, int(mebibytes) * 2**20 if mebibytes.isdecimal() else 0, driver)
        for name, mebibytes, driver in (row for row in rows if len(row) == _GPU_FIELDS)
    )


def _torch_uses_gpu() -> bool | None:
    if not has_module("torch"):
        return None
    try:
        import torch
    except (ImportError, OSError):  # a library that it needs is missing
        return False
    return bool(torch.cuda.is_available())
