"""Checks a PIRLNav checkpoint: its contents, and agreement and speed of the chosen engine."""

import statistics
import time

from vsnbench.installation import command_to_add
from vsnbench.models.checkpoints.torch_runtime import torch_is_installed
from vsnbench.models.contract import ModelCheck, Timing
from vsnbench.models.pirlnav.acceleration import choose_engine, reference_engine
from vsnbench.models.pirlnav.checkpoint import Checkpoint
from vsnbench.models.pirlnav.engine import Engine, synthetic_steps
from vsnbench.models.pirlnav.settings import PIRLNavSettings

_TIMED_STEPS = 40
_TIMED_S = 3.0


def check_checkpoint(checkpoint: Checkpoint, settings: PIRLNavSettings, device: str) -> ModelCheck:
    """Check a checkpoint.

    Raises:
        UsageError: the device is unknown, or the settings contradict each other.
        ModelError: the machine lacks the device or the runtime.
    """
    chosen = choose_engine(checkpoint, settings, device)
    sizes = checkpoint.architecture
    agreement, warning = chosen.agreement, chosen.refused
    engines = [chosen.engine]
    if not torch_is_installed():
        warning = f"not compared with PyTorch, which is not installed: {command_to_add('neural')}"
    elif agreement is not None:
        engines.insert(0, reference_engine(checkpoint))
    parity = None
    if agreement is not None:
        parity = {
            "agrees": agreement.holds,
            "steps": agreement.steps,
            "largest_logit_difference": agreement.largest_difference,
            "tolerance": agreement.tolerance,
            "different_actions": agreement.different_actions,
        }
    return ModelCheck(
        model="pirlnav",
        weights=checkpoint.path,
        sha256=checkpoint.sha256,
        size_bytes=checkpoint.path.stat().st_size,
        facts={
            "architecture": sizes.summary,
            "image": f"{sizes.image_size_px} x {sizes.image_size_px} px",
            "actions": sizes.actions,
            "goals": sizes.goals,
            "tensors": len(checkpoint.weights),
            "parameters": checkpoint.parameter_count,
            "critic": sizes.critic,
            "trainer": checkpoint.trainer or None,
            "training_steps": checkpoint.training_step,
            "key_prefix": checkpoint.prefix,
        },
        chosen_engine=chosen.engine.label,
        parity=parity,
        timings=tuple(time_steps(engine, checkpoint) for engine in engines),
        warning=warning,
    )


def time_steps(engine: Engine, checkpoint: Checkpoint) -> Timing:
    """Time single steps of an engine after a warm-up, for a few seconds at most."""
    steps = synthetic_steps(checkpoint.architecture)
    for step in steps:
        engine.step(step)
    durations_ms: list[float] = []
    for index in range(_TIMED_STEPS):
        if sum(durations_ms) > _TIMED_S * 1e3:
            break
        start_s = time.perf_counter()
        engine.step(steps[index % len(steps)])
        durations_ms.append((time.perf_counter() - start_s) * 1e3)
    return Timing(engine.label, statistics.median(durations_ms), len(durations_ms))
