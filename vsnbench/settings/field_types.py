"""Types that a field of a settings file may have, looked up in the file's pydantic model."""

from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic.fields import FieldInfo

Location = tuple[int | str, ...]
"""A field, as pydantic names it: ("walls", 2, "start")."""


def models_at(model: type, location: Location) -> list[type]:
    """Return the models that a field may be, through lists, unions and tagged unions."""
    return [found for annotation in types_at(model, location) for found in _parts(annotation) if _is_model(found)]


def types_at(model: type, location: Location) -> list[Any]:
    """Return the annotations that a field may have; a union gives each of its members."""
    here: list[Any] = [model]
    for part in location:
        here = _inside(here, part)
    return here


def without_types(model: type, location: Location) -> Location:
    """Return a location without the types that pydantic tried there, as in ("height_m", "constrained-float")."""
    kept: Location = ()
    for part in location:
        here = [member for annotation in types_at(model, kept) for member in _alternatives(annotation)]
        if isinstance(part, int) or any(_is_model(member) or get_origin(member) is dict for member in here):
            kept = (*kept, part)
    return kept


def takes_text(annotation: Any) -> bool:
    """Return whether a list may contain text, such as goal categories or names."""
    return str in _parts(annotation)


def is_mapping(annotation: Any) -> bool:
    """Return whether a value may be a mapping with arbitrary keys."""
    return any(get_origin(member) is dict for member in _alternatives(annotation))


def lengths_of(annotation: Any) -> set[int]:
    """Return the possible lengths of a list of fixed length; empty for a list of any length."""
    shapes = [get_args(member) for member in _alternatives(annotation) if get_origin(member) is tuple]
    return {len(shape) for shape in shapes if Ellipsis not in shape}


def description_at(model: type, location: Location) -> str:
    """Return the model's description of a field or of the list around it, or an empty string."""
    while location and isinstance(location[-1], int):
        location = location[:-1]
    if not location:
        return ""
    for found in models_at(model, location[:-1]):
        for name, field in _declared(found).items():
            if location[-1] in (name, field.alias):
                return field.description or ""
    return ""


def fields_of(models: list[type], *, required: bool = False) -> list[str]:
    """Return the names of all fields, or of the required ones."""
    fields = (item for model in models for item in _declared(model).items())
    return list(dict.fromkeys(field.alias or name for name, field in fields if field.is_required() or not required))


def _inside(here: list[Any], part: int | str) -> list[Any]:
    alternatives = [member for annotation in here for member in _alternatives(annotation)]
    if isinstance(part, int):
        return [inner for member in alternatives for inner in _entries(member, part)]
    fields = [
        field.annotation
        for member in alternatives
        if _is_model(member)
        for name, field in _declared(member).items()
        if part in (name, field.alias)
    ]
    if fields:
        return fields
    values = [get_args(member)[1] for member in alternatives if get_origin(member) is dict]
    return values or alternatives  # pydantic adds the tag of a tagged union to the location; it is not in the file


def _entries(annotation: Any, place: int) -> list[Any]:
    inner = [argument for argument in get_args(annotation) if argument is not Ellipsis]
    if get_origin(annotation) is tuple and Ellipsis not in get_args(annotation):
        return inner[place : place + 1]
    return inner[:1] if get_origin(annotation) in (list, tuple) else []


def _alternatives(annotation: Any) -> list[Any]:
    """Return the members of a union, or the annotation itself, without metadata."""
    if hasattr(annotation, "__metadata__"):
        return _alternatives(annotation.__origin__)
    if get_origin(annotation) in (Union, UnionType):
        return [found for part in get_args(annotation) for found in _alternatives(part)]
    return [annotation]


def _parts(annotation: Any) -> list[Any]:
    """Return every plain type in an annotation, however deep."""
    found: list[Any] = []
    for member in _alternatives(annotation):
        inner = get_args(member)
        found += [member] if not inner else [part for part_type in inner for part in _parts(part_type)]
    return found


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and get_origin(annotation) is None and bool(_declared(annotation))


def _declared(model: type) -> dict[str, FieldInfo]:
    """Return the fields of a pydantic model or dataclass; none for other types."""
    fields: dict[str, FieldInfo] = getattr(model, "__pydantic_fields__", {})
    return fields
