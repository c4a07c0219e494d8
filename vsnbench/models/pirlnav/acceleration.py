"""Chooses what runs the network: device, runtime, precision, threads; and uses nothing before it agreed with eager."""

import importlib.util
import logging
import os
import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from vsnbench.errors import ModelError, UsageError
from vsnbench.machine_cache import found_array, kept_array, key_of
from vsnbench.models.pirlnav.checkpoint import Checkpoint
from vsnbench.models.pirlnav.engine import (
    GPU_TOLERANCE,
    HALF_TOLERANCE,
    SINGLE_TOLERANCE,
    Agreement,
    Engine,
    compare,
    synthetic_steps,
)
from vsnbench.models.pirlnav.network import PIRLNavNetwork, build_network
from vsnbench.models.pirlnav.settings import PIRLNavSettings, Precision, Runtime
from vsnbench.models.pirlnav.torch_engine import TorchEngine
from vsnbench.models.torch_runtime import available_device, gpu_name

logger = logging.getLogger(__name__)

_MOST_THREADS = 8
"""One image at a time gains nothing from more."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenEngine:
    """The engine, and how it came out against the reference."""

    engine: Engine
    runtime: Runtime
    """`torch` or `onnxruntime`."""
    device: str
    precision: Precision
    """`single` or `half`."""
    agreement: Agreement | None
    """None for the reference itself."""
    refused: str = ""
    """Why something faster is not used."""


def choose_engine(checkpoint: Checkpoint, settings: PIRLNavSettings, device: str) -> ChosenEngine:
    """Build the fastest engine that the settings and the machine allow, and compare it with PyTorch on the CPU.

    An engine that disagrees is not used: a warning says by how much, and the reference takes its place. With the device
    `auto` a GPU is used where a step takes less time on it, which a small network's does not: launching its hundreds of
    kernels one after another takes longer than the CPU needs for all of it.

    Raises:
        UsageError: there is no such kind of device, or the settings contradict each other.
        ModelError: the machine has no such device, or lacks the runtime that the settings name.
    """
    best = available_device(device)
    half = settings.precision is Precision.HALF
    if half and best != "cuda":
        raise UsageError(f"precision: half needs a CUDA device, not {best}")
    exported = settings.runtime is Runtime.ONNXRUNTIME
    if exported and (half or device not in ("auto", "cpu")):
        raise UsageError("runtime: onnxruntime runs on the CPU only", advice=f"use --device cpu, not {best}")
    threads = limit_threads(settings.threads)
    if best == "cpu" or exported:
        return _on_cpu(checkpoint, settings, threads)
    if device == "auto" and not half:
        return _on_the_faster(best, checkpoint, settings, threads)
    return _on_gpu(best, checkpoint, half=half)


def _on_the_faster(gpu: str, checkpoint: Checkpoint, settings: PIRLNavSettings, threads: int) -> ChosenEngine:
    """Return the CPU's engine or the GPU's: measured once a machine; the GPU's where the answer cannot be kept."""
    key = key_of(
        checkpoint.sha256, _processor(), threads, settings.runtime.value, torch.__version__, gpu, gpu_name(gpu)
    )
    place = ("devices", key, np.float64, (2,))
    if found_array(*place) is None:
        engines = (_on_cpu(checkpoint, settings, threads).engine, _on_gpu(gpu, checkpoint, half=False).engine)
        kept_array(*place, lambda: _step_times_s(engines, checkpoint))
    times_s = found_array(*place)
    if times_s is not None and times_s[0] <= times_s[1]:
        logger.info("the CPU is the faster one for this network, so the GPU is not used")
        return _on_cpu(checkpoint, settings, threads)
    return _on_gpu(gpu, checkpoint, half=False)


def _on_gpu(gpu: str, checkpoint: Checkpoint, *, half: bool) -> ChosenEngine:
    reference = TorchEngine(build_network(checkpoint.architecture, dict(checkpoint.weights)))
    own = {name: values.clone() for name, values in checkpoint.weights.items()}
    candidate = TorchEngine(build_network(checkpoint.architecture, own), gpu, half=half)
    agreement = compare(reference, candidate, checkpoint.architecture, HALF_TOLERANCE if half else GPU_TOLERANCE)
    if agreement.holds:
        precision = Precision.HALF if half else Precision.SINGLE
        return ChosenEngine(candidate, Runtime.TORCH, gpu, precision, agreement)
    return _reference_only(reference, _disagreement(candidate, agreement))


def _on_cpu(checkpoint: Checkpoint, settings: PIRLNavSettings, threads: int) -> ChosenEngine:
    network = build_network(checkpoint.architecture, dict(checkpoint.weights))
    reference = TorchEngine(network)
    if settings.runtime is Runtime.TORCH:
        return _reference_only(reference)
    lacking = [name for name in ("onnx", "onnxruntime") if importlib.util.find_spec(name) is None]
    if lacking:
        if settings.runtime is Runtime.ONNXRUNTIME:
            raise ModelError(
                f"runtime: onnxruntime needs {' and '.join(lacking)}", advice="pip install 'vsnbench[neural]'"
            )
        return _reference_only(reference, f"{' and '.join(lacking)} not installed")
    candidate = _onnx_engine(checkpoint, network, threads)
    if isinstance(candidate, str):
        return _reference_only(reference, candidate)
    agreement = compare(reference, candidate, checkpoint.architecture, SINGLE_TOLERANCE)
    if not agreement.holds:
        return _reference_only(reference, _disagreement(candidate, agreement))
    if settings.runtime is Runtime.AUTO and _is_slower(candidate, reference, checkpoint, threads):
        logger.info("PyTorch is the faster one on this machine, so onnxruntime is not used")
        return _reference_only(reference)
    return ChosenEngine(candidate, Runtime.ONNXRUNTIME, "cpu", Precision.SINGLE, agreement)


def _is_slower(candidate: Engine, reference: Engine, checkpoint: Checkpoint, threads: int) -> bool:
    """Return whether the reference takes a step in less time here: measured once a machine, and then kept to.

    Every process of this machine answers the same, since the last bits of logits are an engine's own. Where the answer
    cannot be kept, it is no.
    """
    key = key_of(checkpoint.sha256, _processor(), threads, reference.label, candidate.label)
    place = ("engines", key, np.float64, (2,))
    kept_array(*place, lambda: _step_times_s((reference, candidate), checkpoint))
    times_s = found_array(*place)
    return times_s is not None and bool(times_s[0] < times_s[1])


def _step_times_s(engines: Sequence[Engine], checkpoint: Checkpoint) -> npt.NDArray[np.float64]:
    """Return the shortest time of a step of each engine, taken by turns."""
    steps = synthetic_steps(checkpoint.architecture)
    best_s = np.full(len(engines), np.inf)
    for step in steps[:1] * 2 + steps:
        for number, engine in enumerate(engines):
            began_s = time.perf_counter()
            engine.step(step)
            best_s[number] = min(best_s[number], time.perf_counter() - began_s)
    return best_s


def _processor() -> str:
    """Return what the processor calls itself."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = sorted({line for line in lines if line.startswith(("model name", "flags", "Features", "CPU part"))})
    return "\n".join(named) or f"{platform.machine()} {platform.processor()}"


def _onnx_engine(checkpoint: Checkpoint, network: PIRLNavNetwork, threads: int) -> Engine | str:
    """Return the onnxruntime engine, or why there is none; a spoilt file in the cache is exported anew, once."""
    from vsnbench.models.pirlnav.onnx_engine import OnnxEngine, exported_graph

    problem = ""
    for _ in range(2):
        try:
            graph = exported_graph(network, checkpoint.sha256)
        except (OSError, RuntimeError, ModelError) as error:
            problem = str(error).partition("\n")[0]
            break
        try:
            return OnnxEngine(graph, network, threads)
        except ModelError as error:
            problem = str(error)
            graph.unlink(missing_ok=True)
    return f"onnxruntime cannot be used: {problem}"


def _reference_only(reference: TorchEngine, refused: str = "") -> ChosenEngine:
    if refused:
        logger.warning("%s; running in PyTorch on the CPU, which is slower", refused)
    return ChosenEngine(reference, Runtime.TORCH, "cpu", Precision.SINGLE, None, refused)


def _disagreement(candidate: Engine, agreement: Agreement) -> str:
    return (
        f"{candidate.label} disagrees with PyTorch on the CPU (logits off by {agreement.largest_difference:.2g}, "
        f"allowed {agreement.tolerance:.2g}; {agreement.different_actions} of {agreement.steps} actions differ)"
    )


def limit_threads(wanted: int | None) -> int:
    """Set how many threads PyTorch computes with, and return that number for other runtimes.

    PyTorch's own default, which respects OMP_NUM_THREADS, is kept where it is small.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = wanted or min(torch.get_num_threads(), cores, _MOST_THREADS)
    if threads != torch.get_num_threads():
        torch.set_num_threads(threads)
    return threads
