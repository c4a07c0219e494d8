"""The normal equations of a placing's fit: what all looks share, and for each group of surfaces its own two unknowns.

The own unknowns are eliminated, so that what is left of the pose's covariance counts what the survey errs by. An object
that may have been moved, so that nothing but the pose shows it, widens it by how likely that is, given what was seen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]

OWN = 2
"""Unknowns of a group."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The linearised residuals of N pixels."""

    residual_m: Floats
    """(N,) distance beyond the plane, as the state has it."""
    common: Floats
    """(N, C) derivatives by what all looks share; the pose comes first."""
    group: Ints
    """(N,)."""
    own: Floats
    """(N, 2) derivatives by the group's own unknowns."""
    weight: Floats
    """(N,) inverse variance, robust."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known without looking."""

    common: Floats
    """(C,) standard deviations about 0."""
    own: Floats
    """(G, 2)."""
    stretches: float
    """How many independent stretches of surface the pixels of one group are worth at most."""


class NormalEquations:
    """One linearisation's."""

    def __init__(self, rows: Sequence[Rows], prior: Prior, now: Floats, steps: Floats) -> None:
        """Sum them up.

        Args:
            rows: of each look.
            prior: what is known beside them.
            now: (C,) what the common unknowns are taken to be.
            steps: (G, 2) what each group's own are.
        """
        groups = len(prior.own)
        group = np.concatenate([each.group for each in rows])
        common = np.concatenate([each.common for each in rows])
        own = np.concatenate([each.own for each in rows])
        weight = np.concatenate([each.weight for each in rows])
        residual_m = np.concatenate([each.residual_m for each in rows])
        pixels = np.bincount(group, minlength=groups).astype(float)
        weight = weight * np.minimum(1.0, prior.stretches / np.maximum(pixels, 1.0))[group]

        def summed(values: Floats) -> Floats:
            return np.bincount(group, weight * values, groups).astype(np.float64)

        size = common.shape[1]
        self._steps, self._group = steps, group
        self._common, self._weighted, self._residual_m = common, common * weight[:, None], residual_m
        self._own_own = np.stack([[summed(own[:, j] * own[:, k]) for k in range(OWN)] for j in range(OWN)]).transpose(
            2, 0, 1
        )  # (G, 2, 2)
        self._mixed = np.stack([[summed(common[:, j] * own[:, k]) for k in range(OWN)] for j in range(size)]).transpose(
            2, 0, 1
        )  # (G, C, 2)
        self._own_right = -np.stack([summed(own[:, k] * residual_m) for k in range(OWN)], axis=1)
        doubtful = self._own_own + prior.own[:, :, None] ** -2.0 * np.eye(OWN)
        self._inverse = np.linalg.inv(doubtful)
        right = self._own_right - prior.own**-2.0 * steps
        gain = self._mixed @ self._inverse
        self._taken, self._taken_right = gain @ self._mixed.transpose(0, 2, 1), np.einsum("gik,gk->gi", gain, right)
        self._known_right = right
        known = prior.common**-2.0
        self.matrix: Floats = self._weighted.T @ common - self._taken.sum(axis=0) + np.diag(known)
        """(C, C) of the common unknowns, the others eliminated."""
        self._right = -self._weighted.T @ residual_m - self._taken_right.sum(axis=0) - known * now

    def step(self, limit: Floats) -> tuple[Floats, Floats]:
        """Return how far to go: (C,) of the common unknowns, none farther than its limit, and (G, 2) of the own."""
        step = np.linalg.solve(self.matrix, self._right)
        step *= min(1.0, float(np.min(limit / np.maximum(np.abs(step), 1e-12))))
        rest = self._known_right - np.einsum("gik,i->gk", self._mixed, step)
        return step, np.einsum("gkl,gl->gk", self._inverse, rest)

    def doubted(self, objects: Sequence[int], moved: float, surveyed_m: float, moved_m: float) -> Floats:
        """Return the (C, C) covariance of the common unknowns, where each of some groups may have been moved.

        It is that of a mixture: an object that was moved misleads, and the pose is the one that all others make, with
        the covariance that is left then. How likely that is follows from where the object is seen, as the others have
        the pose: what stands where it was surveyed to in every direction that the others can tell was hardly moved in
        the one that they cannot.

        Args:
            objects: numbers of the groups that can be moved.
            moved: how likely each was, before anything was seen.
            surveyed_m: standard deviation of its place where it was not, along x and along y.
            moved_m: where it was.
        """
        covariance = np.linalg.inv(self.matrix)
        widened = covariance.copy()
        for one in objects:
            here = self._group == one
            if not here.any():
                continue
            common, weighted = self._common[here], self._weighted[here]
            said = weighted.T @ common
            of_others = self.matrix - said + self._taken[one]
            others = np.linalg.inv(of_others)
            said_right = weighted.T @ self._residual_m[here]
            away = others @ (said_right + self._taken_right[one])
            # What its pixels say of its step, with the pose as the others have it.
            mixed, step = self._mixed[one], self._steps[one]
            free = np.linalg.solve(said + of_others, mixed)
            clear = self._own_own[one] - mixed.T @ free
            without_step = said_right - mixed @ step + said @ away
            pull = self._own_right[one] + self._own_own[one] @ step - mixed.T @ away + free.T @ without_step
            told = _evidence(clear, pull, moved_m) - _evidence(clear, pull, surveyed_m)
            odds = moved / (1 - moved) * math.exp(min(told, 50.0))
            widened += odds / (1 + odds) * (others - covariance + np.outer(away, away))
        return np.asarray(widened, np.float64)


def _evidence(matrix: Floats, pull: Floats, spread: float) -> float:
    """Return the logarithm of how likely an observation of unknowns is that spread so much about 0.

    Args:
        matrix: (2, 2) how much it says.
        pull: (2,) where to, times the same.
        spread: standard deviation of both unknowns.
    """
    known = np.eye(len(pull)) / spread**2
    _, size = np.linalg.slogdet(np.eye(len(pull)) + spread**2 * matrix)
    return 0.5 * (float(pull @ np.linalg.solve(matrix + known, pull)) - float(size))
