"""The object categories: the seven goal categories of the paper, and the furniture that merely stands around."""

from collections.abc import Collection
from difflib import get_close_matches

GOAL_CATEGORIES: tuple[str, ...] = ("chair", "sofa", "table", "bed", "toilet", "monitor", "plant")
"""In the order of the paper's tables, then the two that only one of its models knows."""

FURNITURE_CATEGORIES: tuple[str, ...] = (
    "bathtub",
    "bookshelf",
    "cabinet",
    "counter",
    "lamp",
    "nightstand",
    "picture",
    "refrigerator",
    "rug",
    "shower",
    "sink",
    "stove",
    "wall_cabinet",
    "wardrobe",
    "washing_machine",
)

CATEGORIES: frozenset[str] = frozenset(GOAL_CATEGORIES + FURNITURE_CATEGORIES)


def meant_category(name: str, known: Collection[str] = CATEGORIES) -> str:
    """Say which category somebody may have meant; all that there are, where none is near."""
    near = get_close_matches(name, sorted(known), n=1, cutoff=0.75)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(sorted(known))}"
