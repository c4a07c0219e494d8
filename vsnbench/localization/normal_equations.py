"""Normal equations of a fit: common unknowns of all looks, and two own unknowns for each group of surfaces.

The own unknowns are eliminated, so that the covariance of the pose includes the errors of the survey. An object that
may have been moved, so that only the pose explains it, increases the covariance by its probability given the images.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]

OWN = 2
"""Number of unknowns of a group."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Linearized residuals of N pixels."""

    residual_m: Floats
    """(N,) distance beyond the plane at the present state."""
    common: Floats
    """(N, C) derivatives by the common unknowns; the pose comes first."""
    group: Ints
    """(N,) group of each pixel."""
    own: Floats
    """(N, 2) derivatives by the group's own unknowns."""
    weight: Floats
    """(N,) robust inverse variance."""


class NormalEquations:
    """Normal equations of one linearization."""

    def __init__(
        self,
        rows: Sequence[Rows],
        common_prior: Floats,
        own_prior: Floats,
        stretches: float,
        now: Floats,
        steps: Floats,
    ) -> None:
        """Sum up the residuals.

        Args:
            rows: residuals of each look.
            common_prior: (C,) prior standard deviations of the common unknowns about 0.
            own_prior: (G, 2) prior standard deviations of the own unknowns.
            stretches: maximum number of independent patches of surface of one group.
            now: (C,) present common unknowns.
            steps: (G, 2) present own unknowns of the groups.
        """
        groups = len(own_prior)
        group = np.concatenate([look_rows.group for look_rows in rows])
        common = np.concatenate([look_rows.common for look_rows in rows])
        own = np.concatenate([look_rows.own for look_rows in rows])
        weight = np.concatenate([look_rows.weight for look_rows in rows])
        residual_m = np.concatenate([look_rows.residual_m for look_rows in rows])
        pixels = np.bincount(group, minlength=groups).astype(float)
        weight = weight * np.minimum(1.0, stretches / np.maximum(pixels, 1.0))[group]

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
        doubtful = self._own_own + own_prior[:, :, None] ** -2.0 * np.eye(OWN)
        self._inverse = np.linalg.inv(doubtful)
        right = self._own_right - own_prior**-2.0 * steps
        gain = self._mixed @ self._inverse
        self._taken, self._taken_right = gain @ self._mixed.transpose(0, 2, 1), np.einsum("gik,gk->gi", gain, right)
        self._known_right = right
        known = common_prior**-2.0
        self.matrix: Floats = self._weighted.T @ common - self._taken.sum(axis=0) + np.diag(known)
        """Return the (C, C) information matrix of the common unknowns, with the others eliminated."""
        self._right = -self._weighted.T @ residual_m - self._taken_right.sum(axis=0) - known * now

    def step(self, limit: Floats) -> tuple[Floats, Floats]:
        """Return the step: (C,) of the common unknowns, each within its limit, and (G, 2) of the own unknowns."""
        step = np.linalg.solve(self.matrix, self._right)
        step *= min(1.0, float(np.min(limit / np.maximum(np.abs(step), 1e-12))))
        rest = self._known_right - np.einsum("gik,i->gk", self._mixed, step)
        return step, np.einsum("gkl,gl->gk", self._inverse, rest)

    def doubted(self, objects: Sequence[int], moved: float, surveyed_m: float, moved_m: float) -> Floats:
        """Return the (C, C) covariance of the common unknowns if each of some groups may have been moved.

        It is the covariance of a mixture. A moved object biases the pose; without it, the other groups determine the
        pose, with the remaining covariance. The probability that it was moved follows from its image, given the pose by
        the other groups: an object that is at its surveyed place in every direction that the others determine was
        probably not moved in the direction that they do not determine.

        Args:
            objects: numbers of the groups that can be moved.
            moved: prior probability that each was moved.
            surveyed_m: standard deviation of the place of an object that was not moved, along x and along y.
            moved_m: standard deviation of the place of an object that was moved.
        """
        covariance = np.linalg.inv(self.matrix)
        widened = covariance.copy()
        for group in objects:
            here = self._group == group
            if not here.any():
                continue
            common, weighted = self._common[here], self._weighted[here]
            information = weighted.T @ common
            of_others = self.matrix - information + self._taken[group]
            others = np.linalg.inv(of_others)
            information_right = weighted.T @ self._residual_m[here]
            away = others @ (information_right + self._taken_right[group])
            # Evidence of its pixels about its offset, with the pose by the other groups.
            mixed, step = self._mixed[group], self._steps[group]
            free = np.linalg.solve(information + of_others, mixed)
            clear = self._own_own[group] - mixed.T @ free
            without_step = information_right - mixed @ step + information @ away
            pull = self._own_right[group] + self._own_own[group] @ step - mixed.T @ away + free.T @ without_step
            log_odds = _evidence(clear, pull, moved_m) - _evidence(clear, pull, surveyed_m)
            odds = moved / (1 - moved) * math.exp(min(log_odds, 50.0))
            widened += odds / (1 + odds) * (others - covariance + np.outer(away, away))
        return np.asarray(widened, np.float64)


def _evidence(matrix: Floats, pull: Floats, spread: float) -> float:
    """Return the log likelihood of an observation of two unknowns with a normal prior about 0.

    Args:
        matrix: (2, 2) information of the observation.
        pull: (2,) information times the observed value.
        spread: standard deviation of both unknowns.
    """
    known = np.eye(len(pull)) / spread**2
    _, size = np.linalg.slogdet(np.eye(len(pull)) + spread**2 * matrix)
    return 0.5 * (float(pull @ np.linalg.solve(matrix + known, pull)) - float(size))
