"""Parametric furniture from boxes, cylinders and ellipsoids; a plain box for categories without models."""

import zlib
from collections.abc import Callable

from vsnbench.errors import SiteError
from vsnbench.simulator.furniture import bathroom, beds, decoration, kitchen, seating, storage, tables
from vsnbench.simulator.furniture.canvas import Canvas, rgb
from vsnbench.simulator.primitives import Primitive
from vsnbench.sites.site import SiteObject

Model = Callable[[Canvas], None]

MODELS: dict[str, dict[str, Model]] = {
    "bathtub": {"bathtub": bathroom.bathtub},
    "bed": {"bed": beds.bed},
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
"""Models of the built-in categories; the first is the default."""


_PLAIN_COLORS = ("#8c6d5a", "#5f7d8c", "#7d8c5f", "#8c5f7d", "#5f8c78", "#8c835f", "#6a5f8c", "#8c5f5f")


def plain_box(canvas: Canvas) -> None:
    """A box of the object's size."""
    canvas.box((canvas.back, canvas.front), (canvas.right, canvas.left), (0, canvas.height), canvas.paint(GREY))


def plain_cylinder(canvas: Canvas) -> None:
    """An upright cylinder that fits into the object's size."""
    radius = min(canvas.front - canvas.back, canvas.left - canvas.right) / 2
    canvas.cylinder(0, 0, (0, canvas.height), radius, canvas.paint(GREY))


GREY = "#808080"
PLAIN_MODELS: dict[str, Model] = {"box": plain_box, "cylinder": plain_cylinder}
"""Models of every category; the first is the default of a category without models of its own."""
EXTRUDED = "extruded"
"""Model of an object with a surveyed outline: the outline at the object's height."""


def plain_color(thing: SiteObject) -> str:
    """Return the colour of an object without a model of its own: as surveyed, else one per category."""
    return thing.color or _PLAIN_COLORS[zlib.crc32(thing.category.encode()) % len(_PLAIN_COLORS)]


def is_extruded(thing: SiteObject) -> bool:
    """Return whether an object is drawn as its surveyed outline."""
    default = thing.model is None and thing.category not in MODELS
    return thing.footprint is not None and (thing.model == EXTRUDED or default)


def furnish(thing: SiteObject) -> list[Primitive]:
    """Return the parts of an object, in its own frame.

    Raises:
        SiteError: the category has no such model (`unknown-model`).
    """
    models = {**MODELS.get(thing.category, {}), **PLAIN_MODELS}
    if thing.model == EXTRUDED and thing.footprint is None:
        raise SiteError(
            f"object {thing.id}: model {EXTRUDED} needs the field footprint, its outline",
            advice=f"measure it, or use another model: {', '.join(models)}",
            code="unknown-model",
        )
    if thing.model not in models and thing.model not in (None, EXTRUDED):
        raise SiteError(
            f"object {thing.id}: unknown model {thing.model!r} of category {thing.category}",
            advice=f"known models: {', '.join(models)}",
            code="unknown-model",
        )
    if is_extruded(thing):
        return []
    color = thing.color if thing.category in MODELS and thing.model not in PLAIN_MODELS else plain_color(thing)
    seed = zlib.crc32(f"{thing.category} {thing.model} {thing.size_m} {color}".encode())
    canvas = Canvas(*thing.size_m, color=rgb(color) if color else None, seed=seed)
    models[thing.model or next(iter(models))](canvas)
    if not canvas.parts:  # too small for details
        plain_box(canvas)
    return canvas.parts
