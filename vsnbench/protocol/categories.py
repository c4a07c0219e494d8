"""The object categories: the seven goal categories of the paper, and the furniture that merely stands around."""

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
