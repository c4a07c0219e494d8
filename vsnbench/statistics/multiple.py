"""Several questions at once: corrected p-values, which models cannot be told apart, and who may be at which rank.

Sources: Holm (1979); Piepho, "An algorithm for a letter-based representation of all-pairwise comparisons" (2004);
Mogstad, Romano, Shaikh and Wilhelm, "Inference for ranks" (2024).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from string import ascii_lowercase


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return the p-values adjusted for being asked together, in the order given (Holm's step-down).

    If all the questions' answers are "no difference", at most 5 % of families hold one below 0.05.
    """
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for place, question in enumerate(sorted(range(len(p_values)), key=lambda each: p_values[each])):
        largest = max(largest, min(1.0, (len(p_values) - place) * float(p_values[question])))
        adjusted[question] = largest
    return tuple(adjusted)


def letters(models: int, differ: Callable[[int, int], bool]) -> tuple[str, ...]:
    """Return a compact letter display: two models share a letter exactly when they cannot be told apart.

    Args:
        models: how many, in the order in which letters are given: the best first.
        differ: whether the i-th and the j-th were found different, i < j.
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
    """Between which ranks a model lies, 1 the best; all models' together at the level of the pairs' correction."""

    best: int
    worst: int


def ranks(models: int, better: Callable[[int, int], bool]) -> tuple[Ranks, ...]:
    """Return the ranks that corrected comparisons of all pairs leave open.

    Args:
        models: how many.
        better: whether the i-th was found better than the j-th, corrected for all pairs.
    """
    everyone = range(models)
    return tuple(
        Ranks(1 + sum(better(j, i) for j in everyone if j != i), models - sum(better(i, j) for j in everyone if j != i))
        for i in everyone
    )
