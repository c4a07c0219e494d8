"""Interface of engines that run the network step by step, and comparison of two engines."""

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vsnbench.models.pirlnav.architecture import Architecture

SINGLE_TOLERANCE = 1e-4
"""Largest difference of logits between float32 engines, relative to the largest logit if that is over 1."""
GPU_TOLERANCE = 1e-3
"""The same for a GPU, which sums in another order."""
HALF_TOLERANCE = 5e-2
"""The same for an encoder in half precision."""


@dataclass(frozen=True, slots=True, eq=False)
class StepInput:
    """Input of the network at one step."""

    image: npt.NDArray[np.float32]
    """(S, S, 3) in [0, 1]."""
    gps_m: tuple[float, float]
    compass_rad: float
    goal: int
    previous_action: int
    """Index of the previous action; ignored at the first step of an episode."""
    begins: bool
    """Whether this is the first step of an episode, which masks memory and previous action."""

    @property
    def previous_index(self) -> int:
        """Row of the previous action's embedding; 0 for no previous action."""
        return 0 if self.begins else self.previous_action + 1


@dataclass(frozen=True, slots=True, eq=False)
class StepOutput:
    """Output of the network."""

    logits: npt.NDArray[np.float32]
    """(actions,)."""
    value: float
    """Expected reward according to the critic; NaN without a critic."""


class Engine(ABC):
    """Runs the network and keeps the memory of the episode."""

    label: str
    """For example `onnxruntime on cpu, 4 threads`."""
    memory: Any = None
    """Recurrent state after the last step."""

    @abstractmethod
    def step(self, step: StepInput) -> StepOutput:
        """Run one step. The first step of an episode clears the memory."""

    def step_together(self, steps: Sequence[StepInput], memories: Sequence[Any]) -> list[tuple[StepOutput, Any]]:
        """Run a step of several episodes; a memory is None at the first step. Returns output and memory of each."""
        answers = []
        for step, memory in zip(steps, memories, strict=True):
            if memory is not None:
                self.memory = memory
            answers.append((self.step(step), self.memory))
        return answers


@dataclass(frozen=True, slots=True)
class EngineParity:
    """Difference between an engine and the reference."""

    steps: int
    largest_difference: float
    """Largest difference of a logit at any step."""
    tolerance: float
    different_actions: int
    """Steps whose greedy action differs although the reference prefers its own by more than the tolerance."""

    @property
    def holds(self) -> bool:
        """Whether the engine can replace the reference."""
        return self.largest_difference <= self.tolerance and self.different_actions == 0


def compare(reference: Engine, candidate: Engine, architecture: Architecture, tolerance: float) -> EngineParity:
    """Run both engines over the same two short synthetic episodes.

    The tolerance is the allowed difference of logits, relative to the largest logit if that is over 1.
    """
    largest, scale, different, previous = 0.0, 1.0, 0, 0
    steps = synthetic_steps(architecture)
    answers = []
    for step in steps:
        step = replace(step, previous_action=previous)  # noqa: PLW2901
        expected, got = reference.step(step).logits, candidate.step(step).logits
        difference = float(np.abs(expected - got).max())
        largest = max(largest, difference if np.isfinite(difference) else np.inf)
        scale = max(scale, float(np.abs(expected).max()))
        previous = int(expected.argmax())
        answers.append((expected, int(got.argmax())))
    for expected, action in answers:
        different += bool(expected.max() - expected[action] > tolerance * scale)
    return EngineParity(len(steps), largest, tolerance * scale, different)


def synthetic_steps(architecture: Architecture) -> list[StepInput]:
    """Return two fixed synthetic episodes of three steps that resemble driving: smooth images, plausible positions."""
    random = np.random.default_rng(20250)
    size = architecture.image_size_px
    inputs = []
    for episode, step in itertools.product(range(2), range(3)):
        coarse = random.random((8, 8, 3), np.float32)
        image = np.kron(coarse, np.ones((size // 8, size // 8, 1), np.float32))
        noise = random.random((size, size, 3), np.float32)
        inputs.append(
            StepInput(
                image=(0.9 * image + 0.1 * noise).astype(np.float32),
                gps_m=(float(random.uniform(-4, 4)), float(random.uniform(-4, 4))),
                compass_rad=float(random.uniform(-np.pi, np.pi)),
                goal=episode % architecture.goals,
                previous_action=0,
                begins=step == 0,
            )
        )
    return inputs
