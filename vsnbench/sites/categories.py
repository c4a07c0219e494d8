"""Object categories: the seven goal categories of the paper, and furniture."""

import re
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
    slug = _slug(word)
    return ALIASES.get(slug, slug)


def _slug(word: str) -> str:
    return "_".join(word.lower().replace("-", " ").replace("_", " ").split())


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
    slug = _slug(word)
    near = get_close_matches(slug, sorted(CATEGORIES), n=1, cutoff=0.75)
    return _SYNONYMS.get(slug, "") or (near[0] if near else "")


def suggest_category(name: str) -> str:
    """Return advice for an unknown category: the likely one, or all categories."""
    slug = _slug(name)
    if other := slug if slug in CATEGORIES else _SYNONYMS.get(slug):
        return f"write {other}"
    general = slug.rpartition("_")[2]  # the chair of an office chair
    if general in CATEGORIES:
        return f"write {general}, and use the field model for the variant"
    near = get_close_matches(name, sorted(CATEGORIES), n=1, cutoff=0.75)
    if not near and slug != name and CATEGORY_WORD.fullmatch(slug):
        return f"write {slug}"
    return f"did you mean {near[0]}?" if near else f"known categories: {', '.join(sorted(CATEGORIES))}"
