"""Object categories: the seven goal categories of the paper, and furniture."""

import re
from collections.abc import Collection
from difflib import get_close_matches

GOAL_CATEGORIES: tuple[str, ...] = ("chair", "sofa", "table", "bed", "toilet", "monitor", "plant")
"""In the order of the paper's tables; the last two are known to only one of its models."""

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


CATEGORY_WORD = re.compile(r"[a-z][a-z0-9_]{0,79}")
"""Form of a category: one word of lower case, with underscores."""

ALIASES: dict[str, str] = {
    "couch": "sofa",
    "dining_table": "table",
    "potted_plant": "plant",
    "tv": "monitor",
    "tv_monitor": "monitor",
    "tvmonitor": "monitor",
}
"""Names of COCO-80, HM3D-6 and MP3D-21 for categories that have another name here; the other names are the same."""


def canonical_category(word: str) -> str:
    """Return the category that a word names: `potted plant` is `plant`, `Sports Ball` is `sports_ball`."""
    slug = "_".join(word.strip().lower().replace("-", " ").replace("_", " ").split())
    return ALIASES.get(slug, slug)


_SYNONYMS = {
    **ALIASES,
    "armchair": "chair",
    "basin": "sink",
    "bath": "bathtub",
    "bookcase": "bookshelf",
    "carpet": "rug",
    "closet": "wardrobe",
    "cooker": "stove",
    "cupboard": "cabinet",
    "desk": "table",
    "display": "monitor",
    "dresser": "cabinet",
    "fridge": "refrigerator",
    "loo": "toilet",
    "oven": "stove",
    "painting": "picture",
    "pot_plant": "plant",
    "screen": "monitor",
    "settee": "sofa",
    "shelf": "bookshelf",
    "stool": "chair",
    "television": "monitor",
    "washbasin": "sink",
    "washer": "washing_machine",
    "wc": "toilet",
    "worktop": "counter",
}


def near_category(word: str) -> str:
    """Return the built-in category that an unknown category is probably meant to be, or an empty string."""
    plain = word.strip().lower().replace(" ", "_").replace("-", "_")
    other = _SYNONYMS.get(plain, "")
    near = get_close_matches(plain, sorted(CATEGORIES), n=1, cutoff=0.75)
    return other or (near[0] if near else "")


def suggest_category(name: str, known: Collection[str] = CATEGORIES) -> str:
    """Return advice for an unknown category: the likely one, or all categories."""
    plain = name.strip().lower().replace(" ", "_").replace("-", "_")
    other = plain if plain in known else _SYNONYMS.get(plain)
    if other in known:
        return f"write {other}"
    general = plain.rpartition("_")[2]  # the chair of an office chair
    if general in known:
        return f"write {general}, and use the field model for the variant"
    near = get_close_matches(name, sorted(known), n=1, cutoff=0.75)
    if not near and plain != name and CATEGORY_WORD.fullmatch(plain):
        return f"write {plain}"
    return f"did you mean {near[0]}?" if near else f"known categories: {', '.join(sorted(known))}"
