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


_ALSO_CALLED = {
    "armchair": "chair",
    "basin": "sink",
    "bath": "bathtub",
    "bookcase": "bookshelf",
    "carpet": "rug",
    "closet": "wardrobe",
    "cooker": "stove",
    "couch": "sofa",
    "cupboard": "cabinet",
    "desk": "table",
    "dining_table": "table",
    "display": "monitor",
    "dresser": "cabinet",
    "fridge": "refrigerator",
    "loo": "toilet",
    "oven": "stove",
    "painting": "picture",
    "pot_plant": "plant",
    "potted_plant": "plant",
    "screen": "monitor",
    "settee": "sofa",
    "shelf": "bookshelf",
    "stool": "chair",
    "television": "monitor",
    "tv": "monitor",
    "tv_monitor": "monitor",
    "washbasin": "sink",
    "washer": "washing_machine",
    "wc": "toilet",
    "worktop": "counter",
}


def meant_category(name: str, known: Collection[str] = CATEGORIES) -> str:
    """Say which category somebody may have meant; all that there are, where none is near."""
    plain = name.strip().lower().replace(" ", "_").replace("-", "_")
    other = plain if plain in known else _ALSO_CALLED.get(plain)
    if other in known:
        return f"write {other}"
    kind = plain.rpartition("_")[2]  # a kind of it: an office chair, a dining table
    if kind in known:
        return f"write {kind}; `model` says of which kind"
    near = get_close_matches(name, sorted(known), n=1, cutoff=0.75)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(sorted(known))}"
