"""Checks of this machine: each lack is named with the task that needs the missing part."""

from dataclasses import replace
from pathlib import Path

import pytest

from vsnbench.files.disk_speed import write_speed
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.robots.checkup.machine import check_installation, check_results
from vsnbench.robots.checkup.result import CheckResult, Health
from vsnbench.runtime.machine import Extra, Gpu, MachineFacts, Package, gather_machine_facts

GIB = 2**30
NUMPY = Package("numpy", ">=2.0", "2.1.0", fits=True)
GOOD = MachineFacts(
    vsnbench="1.0.0",
    python="CPython 3.12.3",
    system="Debian GNU/Linux 12 (bookworm)",
    kernel="Linux 6.1.0",
    architecture="x86_64",
    libc="glibc 2.36",
    processor="a processor",
    cores=4,
    memory_bytes=16 * GIB,
    available_memory_bytes=8 * GIB,
    gpus=(Gpu("a GPU", 8 * GIB, "550.1"),),
    torch_uses_gpu=True,
    browser="firefox",
    display=True,
    ros=("ROS 2",),
    packages=(NUMPY,),
    extras=(Extra("video", "vsnbench export video", installed=True, packages=(Package("av", ">=14", "18.1", True),)),),
)
WITHOUT_VIDEO = Extra("video", "vsnbench export video", installed=False, packages=(Package("av", ">=14", None, False),))
OLD_VIDEO = Extra("video", "vsnbench export video", installed=True, packages=(Package("av", ">=14", "9.0", False),))


def found(facts: MachineFacts) -> dict[str, CheckResult]:
    return {check.what: check for check in check_installation(facts)}


def test_a_complete_machine_has_no_warning() -> None:
    assert {check.health for check in found(GOOD).values()} == {Health.OK}


@pytest.mark.parametrize(
    ("change", "what", "health", "mentioned"),
    [
        ({"architecture": "aarch64"}, "vsnbench", Health.WARNING, "x86_64"),
        ({"kernel": "Darwin 23"}, "vsnbench", Health.WARNING, "Linux"),
        ({"packages": ()}, "packages", Health.WARNING, "docs/install.md"),
        ({"packages": (replace(NUMPY, installed="1.26", fits=False),)}, "packages", Health.FAILED, "numpy 1.26 (needs"),
        ({"packages": (replace(NUMPY, installed=None, fits=False),)}, "packages", Health.FAILED, "numpy missing"),
        ({"available_memory_bytes": GIB // 2}, "machine", Health.WARNING, "0.5 GiB of it free"),
        ({"gpus": (), "torch_uses_gpu": None}, "GPU", Health.ABSENT, "CPU"),
        ({"torch_uses_gpu": False}, "GPU", Health.WARNING, "CUDA"),
        ({"browser": None}, "browser", Health.ABSENT, "--console"),
        ({"display": False}, "browser", Health.OK, "no display"),
        ({"extras": (WITHOUT_VIDEO,)}, "extra video", Health.ABSENT, "for vsnbench export video"),
        ({"extras": (OLD_VIDEO,)}, "extra video", Health.WARNING, "av 9.0 (needs >=14)"),
        ({"ros": ()}, "ROS", Health.ABSENT, "a robot needs it"),
    ],
)
def test_a_lack_is_named_with_its_fix(change: dict[str, object], what: str, health: Health, mentioned: str) -> None:
    check = found(replace(GOOD, **change))[what]  # type: ignore[arg-type]
    assert check.health is health
    assert mentioned in f"{check.seen} {check.advice}"


def test_this_machine_has_no_failed_check(tmp_path: Path) -> None:
    checks = [
        *check_installation(gather_machine_facts()),
        *check_results(ResultsDirectory.locate(tmp_path / "results")),
    ]
    assert [check for check in checks if check.health is Health.FAILED] == []
    assert {"disk", "database"} <= {check.what for check in checks}


def test_the_speed_of_a_disk_is_measured_within_seconds_and_leaves_no_file(tmp_path: Path) -> None:
    assert 10**5 < write_speed(tmp_path) < 10**12
    assert list(tmp_path.iterdir()) == []
