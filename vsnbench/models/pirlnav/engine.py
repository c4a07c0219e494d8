"""What runs the network one step at a time, and how two engines are compared."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vsnbench.models.pirlnav.architecture import Architecture

SINGLE_TOLERANCE = 1e-4
"""Largest difference of logits between float32 engines, relative to the largest logit where that is over 1."""
GPU_TOLERANCE = 1e-3
"""The same on a GPU, which sums in another order."""
HALF_TOLERANCE = 5e-2
"""The same where the encoder runs in half precision."""


@dataclass(frozen=True, slots=True, eq=False)
class StepInput:
    """What the network is told at one step."""

    image: npt.NDArray[np.float32]
    """(S, S, 3) in [0, 1]."""
    gps_m: tuple[float, float]
    compass_rad: float
    goal: int
    previous_action: int
    """Index of the action chosen last; without meaning at the first step of an episode."""
    begins: bool
    """Whether this is the first step of an episode: memory and previous action are masked."""

    @property
    def previous_index(self) -> int:
        """Row of the previous action's embedding; row 0 stands for none."""
        return 0 if self.begins else self.previous_action + 1


@dataclass(frozen=True, slots=True, eq=False)
class StepOutput:
    """What the network answers."""

    logits: npt.NDArray[np.float32]
    """(actions,)."""
    value: float
    """The critic's expectation of reward; NaN without a critic."""


class Engine(Protocol):
    """Runs the network; keeps the memory of the episode."""

    label: str
    """E.g. `onnxruntime on cpu, 4 threads`."""

    def step(self, step: StepInput) -> StepOutput:
        """Take one step; a step that begins an episode forgets the last one."""
        ...


@dataclass(frozen=True, slots=True)
class Agreement:
    """How far an engine is from the reference."""

    steps: int
    largest_difference: float
    """Of any logit at any step."""
    tolerance: float
    different_actions: int
    """Steps at which the greedy action differs although the reference prefers its own by more than the tolerance."""

    @property
    def holds(self) -> bool:
        """Whether the engine may stand in for the reference."""
        return self.largest_difference <= self.tolerance and self.different_actions == 0


def compare(reference: Engine, candidate: Engine, architecture: Architecture, tolerance: float) -> Agreement:
    """Run both engines over the same two short synthetic episodes.

    Args:
        reference: the engine that is right by definition.
        candidate: the one in question.
        architecture: the network's sizes.
        tolerance: allowed difference of logits, relative to the largest logit where that is over 1.
    """
    largest, scale, different, previous = 0.0, 1.0, 0, 0
    steps = synthetic_steps(architecture)
    answers = []
    for step in steps:
        step = StepInput(step.image, step.gps_m, step.compass_rad, step.goal, previous, step.begins)  # noqa: PLW2901
        expected, got = reference.step(step).logits, candidate.step(step).logits
        difference = float(np.abs(expected - got).max())
        largest = max(largest, difference if np.isfinite(difference) else np.inf)
        scale = max(scale, float(np.abs(expected).max()))
        previous = int(expected.argmax())
        answers.append((expected, int(got.argmax())))
    for expected, action in answers:
        different += bool(expected.max() - expected[action] > tolerance * scale)
    return Agreement(len(steps), largest, tolerance * scale, different)


def synthetic_steps(architecture: Architecture, episodes: int = 2, steps: int = 3) -> list[StepInput]:
    """Return made-up steps that look like driving: smooth images, plausible positions; always the same."""
    random = np.random.default_rng(20250)
    size = architecture.image_size_px
    made = []
    for episode in range(episodes):
        for index in range(steps):
            coarse = random.random((8, 8, 3), np.float32)
            image = np.kron(coarse, np.ones((size // 8, size // 8, 1), np.float32))
            noise = random.random((size, size, 3), np.float32)
            made.append(
                StepInput(
                    image=(0.9 * image + 0.1 * noise).astype(np.float32),
                    gps_m=(float(random.uniform(-4, 4)), float(random.uniform(-4, 4))),
                    compass_rad=float(random.uniform(-np.pi, np.pi)),
                    goal=episode % architecture.goals,
                    previous_action=0,
                    begins=index == 0,
                )
            )
    return made
