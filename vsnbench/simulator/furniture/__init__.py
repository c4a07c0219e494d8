"""Parametric furniture: every object category has at least one look, made of boxes, cylinders and ellipsoids."""

from collections.abc import Callable

from vsnbench.errors import SiteError
from vsnbench.protocol.site import SiteObject
from vsnbench.simulator.furniture import bathroom, decoration, kitchen, seating, storage, tables
from vsnbench.simulator.furniture.canvas import Canvas, Part, rgb

Model = Callable[[Canvas], None]

MODELS: dict[str, dict[str, Model]] = {
    "bathtub": {"bathtub": bathroom.bathtub},
    "bed": {"bed": seating.bed},
    "bookshelf": {"bookshelf": storage.bookshelf},
    "cabinet": {"cabinet": storage.cabinet, "sideboard": storage.sideboard},
    "chair": {
        "dining_chair": seating.dining_chair,
        "office_chair": seating.office_chair,
        "armchair": seating.armchair,
    },
    "counter": {"counter": kitchen.counter},
    "lamp": {"floor_lamp": decoration.floor_lamp, "table_lamp": decoration.table_lamp},
    "monitor": {"desk_monitor": tables.desk_monitor, "television": tables.television},
    "nightstand": {"nightstand": storage.nightstand},
    "picture": {"picture": decoration.picture},
    "plant": {"plant": decoration.plant},
    "refrigerator": {"refrigerator": kitchen.refrigerator},
    "rug": {"rug": decoration.rug},
    "shower": {"shower": bathroom.shower},
    "sink": {"vanity": bathroom.vanity, "kitchen_sink": kitchen.kitchen_sink},
    "sofa": {"sofa": seating.sofa},
    "stove": {"stove": kitchen.stove},
    "table": {"dining_table": tables.dining_table, "coffee_table": tables.coffee_table, "desk": tables.desk},
    "toilet": {"toilet": bathroom.toilet},
    "wall_cabinet": {"wall_cabinet": storage.wall_cabinet},
    "wardrobe": {"wardrobe": storage.wardrobe},
    "washing_machine": {"washing_machine": kitchen.washing_machine},
}
"""The looks of every category; the first is the one of an object that names none."""


def furnish(thing: SiteObject) -> list[Part]:
    """Return the parts of an object, in its own frame.

    Raises:
        SiteError: the category is unknown, or has no such model.
    """
    looks = MODELS.get(thing.category)
    if looks is None:
        raise SiteError(f"object {thing.id}: unknown category {thing.category!r}; known: {', '.join(sorted(MODELS))}")
    if thing.model is not None and thing.model not in looks:
        raise SiteError(
            f"object {thing.id}: a {thing.category} has no model {thing.model!r}; it has {', '.join(looks)}"
        )
    canvas = Canvas(*thing.size_m, color=rgb(thing.color) if thing.color else None)
    looks[thing.model or next(iter(looks))](canvas)
    if not canvas.parts:  # too small for any detail
        canvas.box(
            (canvas.back, canvas.front), (canvas.right, canvas.left), (0, canvas.height), canvas.paint("#808080")
        )
    return canvas.parts
