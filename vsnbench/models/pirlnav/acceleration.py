"""Chooses device, runtime, precision and threads of the network.

With PyTorch, every other engine is compared with it first. Without PyTorch, onnxruntime runs the network on the CPU.
"""

import logging
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import psutil

from vsnbench.errors import ModelError, UsageError
from vsnbench.files.disk_cache import cached_array, found_array, key_of
from vsnbench.models.checkpoints.torch_runtime import available_device, require_torch, torch_is_installed
from vsnbench.models.pirlnav.checkpoint import Checkpoint
from vsnbench.models.pirlnav.engine import (
    GPU_TOLERANCE,
    HALF_TOLERANCE,
    SINGLE_TOLERANCE,
    Engine,
    EngineParity,
    compare,
    synthetic_steps,
)
from vsnbench.models.pirlnav.onnx_engine import OnnxEngine
from vsnbench.models.pirlnav.settings import PIRLNavSettings, Precision, Runtime
from vsnbench.runtime.resources import granted_cores

logger = logging.getLogger(__name__)

_MAX_THREADS = 8
"""A single image gains nothing from more threads."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenEngine:
    """The engine, and its comparison with the reference."""

    engine: Engine
    runtime: Runtime
    """`torch` or `onnxruntime`."""
    device: str
    precision: Precision
    """`single` or `half`."""
    threads: int
    agreement: EngineParity | None
    """None for the reference itself, and without PyTorch."""
    refused: str = ""
    """Reason why a faster engine is not used."""


def choose_engine(checkpoint: Checkpoint, settings: PIRLNavSettings, device: str) -> ChosenEngine:
    """Build the fastest engine that the settings and the machine allow, and compare it with PyTorch on the CPU.

    If an engine disagrees, the reference is used with a warning. With the device `auto`, a GPU is used only if its
    steps are faster. For a small network they are not: launching its hundreds of kernels takes longer than the whole
    step on the CPU.

    Raises:
        UsageError: the device is unknown, or the settings contradict each other.
        ModelError: the machine lacks the device, or the runtime in the settings.
    """
    if settings.runtime == "torch":
        require_torch()
    best = available_device(device)
    half = settings.precision == "half"
    if half and best != "cuda":
        raise UsageError(f"precision: half needs a CUDA device, not {best}")
    exported = settings.runtime == "onnxruntime"
    if exported and (half or device not in ("auto", "cpu")):
        raise UsageError("runtime: onnxruntime runs on the CPU only", advice=f"use --device cpu, not {best}")
    threads = limit_threads(settings.threads)
    if best == "cpu" or exported:
        return _on_cpu(checkpoint, settings, threads)
    if device == "auto" and not half:
        return _on_the_faster(best, checkpoint, settings, threads)
    return _on_gpu(best, checkpoint, threads, half=half)


def _on_the_faster(gpu: str, checkpoint: Checkpoint, settings: PIRLNavSettings, threads: int) -> ChosenEngine:
    """Return the faster engine, measured once per machine; the GPU's if the result cannot be cached."""
    import torch

    name = torch.cuda.get_device_name() if gpu == "cuda" else ""
    key = key_of(checkpoint.sha256, _processor(), threads, settings.runtime, torch.__version__, gpu, name)
    place = ("devices", key, np.float64, (2,))
    if found_array(*place) is None:
        engines = (_on_cpu(checkpoint, settings, threads).engine, _on_gpu(gpu, checkpoint, threads, half=False).engine)
        cached_array(*place, lambda: _step_times_s(engines, checkpoint))
    times_s = found_array(*place)
    if times_s is not None and times_s[0] <= times_s[1]:
        logger.info("the CPU is faster for this network, so the GPU is not used")
        return _on_cpu(checkpoint, settings, threads)
    return _on_gpu(gpu, checkpoint, threads, half=False)


def _on_gpu(gpu: str, checkpoint: Checkpoint, threads: int, *, half: bool) -> ChosenEngine:
    reference = reference_engine(checkpoint)
    candidate = reference_engine(checkpoint, gpu, half=half)
    agreement = compare(reference, candidate, checkpoint.architecture, HALF_TOLERANCE if half else GPU_TOLERANCE)
    if agreement.holds:
        precision: Precision = "half" if half else "single"
        return ChosenEngine(candidate, "torch", gpu, precision, threads, agreement)
    return _reference_only(reference, threads, _disagreement(candidate, agreement))


def _on_cpu(checkpoint: Checkpoint, settings: PIRLNavSettings, threads: int) -> ChosenEngine:
    if not torch_is_installed():
        return ChosenEngine(OnnxEngine(checkpoint, threads), "onnxruntime", "cpu", "single", threads, None)
    reference = reference_engine(checkpoint)
    if settings.runtime == "torch":
        return _reference_only(reference, threads)
    try:
        candidate = OnnxEngine(checkpoint, threads)
    except ModelError as error:
        return _reference_only(reference, threads, str(error))
    agreement = compare(reference, candidate, checkpoint.architecture, SINGLE_TOLERANCE)
    if not agreement.holds:
        return _reference_only(reference, threads, _disagreement(candidate, agreement))
    if settings.runtime == "auto" and _is_slower(candidate, reference, checkpoint, threads):
        logger.info("PyTorch is faster on this machine, so onnxruntime is not used")
        return _reference_only(reference, threads)
    return ChosenEngine(candidate, "onnxruntime", "cpu", "single", threads, agreement)


def reference_engine(checkpoint: Checkpoint, device: str = "cpu", *, half: bool = False) -> Engine:
    """Return PyTorch's engine of a checkpoint; on the CPU in single precision it is correct by definition."""
    from vsnbench.models.pirlnav.network import build_network
    from vsnbench.models.pirlnav.torch_engine import TorchEngine

    return TorchEngine(build_network(checkpoint.architecture, checkpoint.weights), device, half=half)


def _is_slower(candidate: Engine, reference: Engine, checkpoint: Checkpoint, threads: int) -> bool:
    """Return whether the reference is faster, measured once per machine; False if the result cannot be cached.

    All processes of a machine must use the same engine, because the last bits of logits differ between engines.
    """
    key = key_of(checkpoint.sha256, _processor(), threads, reference.label, candidate.label)
    place = ("engines", key, np.float64, (2,))
    cached_array(*place, lambda: _step_times_s((reference, candidate), checkpoint))
    times_s = found_array(*place)
    return times_s is not None and bool(times_s[0] < times_s[1])


def _step_times_s(engines: Sequence[Engine], checkpoint: Checkpoint) -> npt.NDArray[np.float64]:
    """Return the shortest duration of a step of each engine, measured alternately."""
    steps = synthetic_steps(checkpoint.architecture)
    best_s = np.full(len(engines), np.inf)
    for step in steps[:1] * 2 + steps:
        for number, engine in enumerate(engines):
            start_s = time.perf_counter()
            engine.step(step)
            best_s[number] = min(best_s[number], time.perf_counter() - start_s)
    return best_s


def _processor() -> str:
    """Return a description of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = sorted({line for line in lines if line.startswith(("model name", "flags", "Features", "CPU part"))})
    return "\n".join(named) or f"{platform.machine()} {platform.processor()}"


def _reference_only(reference: Engine, threads: int, refused: str = "") -> ChosenEngine:
    if refused:
        logger.warning("%s; running in PyTorch on the CPU, which is slower", refused)
    return ChosenEngine(reference, "torch", "cpu", "single", threads, None, refused)


def _disagreement(candidate: Engine, agreement: EngineParity) -> str:
    return (
        f"{candidate.label} disagrees with PyTorch on the CPU (logits off by {agreement.largest_difference:.2g}, "
        f"allowed {agreement.tolerance:.2g}; {agreement.different_actions} of {agreement.steps} actions differ)"
    )


def limit_threads(requested: int | None) -> int:
    """Return the number of threads, and set it in PyTorch if that is installed.

    The default is PyTorch's, or else $OMP_NUM_THREADS or the number of cores, up to a limit.
    """
    available = granted_cores()
    if not torch_is_installed():
        usual = os.environ.get("OMP_NUM_THREADS", "")
        default = int(usual) if usual.isdecimal() else psutil.cpu_count(logical=False) or available
        return requested or max(1, min(default, available, _MAX_THREADS))
    import torch

    threads = requested or min(torch.get_num_threads(), available, _MAX_THREADS)
    if threads != torch.get_num_threads():
        torch.set_num_threads(threads)
    return threads
