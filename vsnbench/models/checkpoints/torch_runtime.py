"""Availability of PyTorch, choice of its device, and GPU memory of this process."""

import sys
from dataclasses import dataclass
from typing import Final

from vsnbench.errors import ModelError, UsageError
from vsnbench.installation import command_to_add

DEVICES: Final = ("auto", "cpu", "cuda", "mps")
_CONTEXT_BYTES: Final = 768 * 2**20
"""GPU memory of CUDA and its libraries per process, which PyTorch does not count: 730 MB on an H100."""


@dataclass(frozen=True, slots=True)
class GpuMemory:
    """A GPU's memory, bytes."""

    taken_bytes: int
    """Approximate memory of this process."""
    free_bytes: int
    """Memory not in use."""
    total_bytes: int


def torch_is_installed() -> bool:
    """Return whether PyTorch can be imported; imports it."""
    try:
        import torch  # noqa: F401
    except ImportError:
        return False
    return True


def require_torch() -> None:
    """Check that PyTorch is installed.

    Raises:
        ModelError: it is not installed.
    """
    if not torch_is_installed():
        raise ModelError(f"this model needs PyTorch, which is not installed: {command_to_add('neural')}")


def available_device(requested: str) -> str:
    """Return the requested device, or the best available one for `auto`; without PyTorch, only `cpu`.

    Raises:
        UsageError: the kind of device is unknown.
        ModelError: this machine has no such device.
    """
    if requested not in DEVICES:
        raise UsageError(f"unknown device {requested!r}; known: {', '.join(DEVICES)}")
    if not torch_is_installed():
        if requested in ("auto", "cpu"):
            return "cpu"
        raise ModelError(f"a {requested} device needs PyTorch, which is not installed: {command_to_add('neural')}")
    import torch

    available = {"cpu": True, "cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    if requested == "auto":
        return next(device for device in ("cuda", "mps", "cpu") if available[device])
    if not available[requested]:
        raise ModelError(f"PyTorch {torch.__version__} finds no {requested} device", advice="use --device auto or cpu")
    return requested


def gpu_memory() -> GpuMemory | None:
    """Return the GPU memory of this process, or None if it uses no CUDA device."""
    torch = sys.modules.get("torch")
    if torch is None or not torch.cuda.is_initialized():
        return None
    free, total = torch.cuda.mem_get_info()
    return GpuMemory(torch.cuda.memory_reserved() + _CONTEXT_BYTES, free, total)
