"""Facts about this machine, against what the operating system and the package files say."""

import os
import platform
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import psutil
import pytest

from vsnbench.runtime import resources
from vsnbench.runtime.machine import EXTRAS, Gpu, gather_machine_facts

ROOT = Path(__file__).resolve().parents[2]


def test_facts_agree_with_the_system_and_the_package_files() -> None:
    facts = gather_machine_facts()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert facts.python.endswith(".".join(map(str, sys.version_info[:3])))
    assert facts.architecture == platform.machine()
    assert 1 <= facts.cores <= (os.cpu_count() or 1)
    assert 0 < facts.available_memory_bytes <= facts.memory_bytes <= psutil.virtual_memory().total
    assert {package.name: package.installed for package in facts.packages}["numpy"] == version("numpy")
    assert [extra.name for extra in facts.extras] == list(EXTRAS)
    assert EXTRAS.keys() == project["optional-dependencies"].keys() - {"docs", "dev"}
    table = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    assert [name for name in EXTRAS if f"`{name}`" not in table] == []


@pytest.mark.parametrize(
    ("printed", "gpus"),
    [
        ("NVIDIA H100 80GB HBM3, 81559, 550.54.15", (Gpu("NVIDIA H100 80GB HBM3", 81559 * 2**20, "550.54.15"),)),
        ("Orin (nvgpu), [N/A], 540.4.0", (Gpu("Orin (nvgpu)", 0, "540.4.0"),)),
        ("No devices were found", ()),
        ("", ()),
    ],
)
def test_gpus_are_read_from_nvidia_smi(
    printed: str, gpus: tuple[Gpu, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "nvidia-smi"
    program.write_text(f"#!/bin/sh\necho '{printed}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert gather_machine_facts().gpus == gpus


def test_a_container_limits_cores_and_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resources, "_CGROUP", tmp_path)
    assert resources.total_memory() == psutil.virtual_memory().total
    for name, text in {"cpu.max": "50000 100000", "memory.max": f"{2**20}", "memory.current": f"{2**19}"}.items():
        (tmp_path / name).write_text(f"{text}\n")
    assert (resources.granted_cores(), resources.total_memory(), resources.available_memory()) == (1, 2**20, 2**19)


def test_a_broken_pytorch_uses_no_gpu(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "nvidia-smi").write_text("#!/bin/sh\necho 'NVIDIA H100, 81559, 550.54.15'\n")
    (tmp_path / "nvidia-smi").chmod(0o755)
    (tmp_path / "torch.py").write_text("raise OSError('libcudnn.so.9: cannot open shared object file')\n")
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "torch", raising=False)
    assert gather_machine_facts().torch_uses_gpu is False
