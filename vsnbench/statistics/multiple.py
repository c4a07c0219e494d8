"""Multiple comparisons: adjusted p-values, compact letter display and rank intervals.

Sources: Holm (1979); Piepho, "An algorithm for a letter-based representation of all-pairwise comparisons" (2004);
Mogstad, Romano, Shaikh and Wilhelm, "Inference for ranks" (2024).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from string import ascii_lowercase


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return the p-values adjusted by Holm's step-down method, in the given order.

    If every null hypothesis is true, the probability of any adjusted p-value below 0.05 is at most 5 %.
    """
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for place, question in enumerate(sorted(range(len(p_values)), key=lambda index: p_values[index])):
        largest = max(largest, min(1.0, (len(p_values) - place) * float(p_values[question])))
        adjusted[question] = largest
    return tuple(adjusted)


def simultaneous(questions: int, alpha: float = 0.05) -> float:
    """Return the confidence level at which the intervals of all questions hold together with 1 - alpha (Bonferroni).

    A winner needs Holm's p-value and this interval, so that every command names the same winners of the same questions.
    """
    return 1 - alpha / max(1, questions)


def letters(models: int, differ: Callable[[int, int], bool]) -> tuple[str, ...]:
    """Return a compact letter display: two models share a letter exactly if no difference between them was found.

    Args:
        models: number of models, in the order in which letters are assigned: best first.
        differ: whether a difference between the i-th and j-th was found, i < j.
    """
    groups: list[set[int]] = [set(range(models))]
    for i in range(models):
        for j in range(i + 1, models):
            if not differ(i, j):
                continue
            split: list[set[int]] = []
            for group in groups:
                split += [group - {i}, group - {j}] if {i, j} <= group else [group]
            groups = [
                group
                for place, group in enumerate(split)
                if not any(group < other or (group == other and place > earlier) for earlier, other in enumerate(split))
            ]
    groups.sort(key=sorted)
    return tuple("".join(_letter(place) for place, group in enumerate(groups) if i in group) for i in range(models))


def _letter(place: int) -> str:
    return ascii_lowercase[place] if place < len(ascii_lowercase) else f"({place + 1})"


@dataclass(frozen=True, slots=True)
class Ranks:
    """Best and worst rank of a model, 1 is the best; simultaneous for all models."""

    best: int
    worst: int


def ranks(models: int, better: Callable[[int, int], bool]) -> tuple[Ranks, ...]:
    """Return the ranks that are compatible with the corrected pairwise comparisons.

    Args:
        models: number of models.
        better: whether the i-th was found better than the j-th, corrected for all pairs.
    """
    everyone = range(models)
    return tuple(
        Ranks(1 + sum(better(j, i) for j in everyone if j != i), models - sum(better(i, j) for j in everyone if j != i))
        for i in everyone
    )
