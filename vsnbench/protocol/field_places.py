"""Which types a place of a settings file may hold, by the model that the file has to be."""

from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel

Location = tuple[int | str, ...]
"""A field, as pydantic names it: ("walls", 2, "start")."""


def models_at(model: type[BaseModel], location: Location) -> list[type[BaseModel]]:
    """Return the models that a place may be, following lists, unions and the tags that choose in them."""
    return [found for each in types_at(model, location) for found in _parts(each) if _is_model(found)]


def types_at(model: type[BaseModel], location: Location) -> list[Any]:
    """Return the annotations that a place may have; the kinds of a union by themselves."""
    here: list[Any] = [model]
    for part in location:
        here = _inside(here, part)
    return here


def takes_text(annotation: Any) -> bool:
    """Return whether a list has text in it: goal categories, names."""
    return str in _parts(annotation)


def is_mapping(annotation: Any) -> bool:
    """Return whether names of the file's own choice lead to its values."""
    return any(get_origin(one) is dict for one in _alternatives(annotation))


def lengths_of(annotation: Any) -> set[int]:
    """Return how many values a list of a fixed length has; empty for one of any length."""
    shapes = [get_args(one) for one in _alternatives(annotation) if get_origin(one) is tuple]
    return {len(shape) for shape in shapes if Ellipsis not in shape}


def description_at(model: type[BaseModel], location: Location) -> str:
    """Return what the model says of a field, or of the list that it is in; empty where it says nothing."""
    while location and isinstance(location[-1], int):
        location = location[:-1]
    if not location:
        return ""
    for found in models_at(model, location[:-1]):
        for name, field in found.model_fields.items():
            if location[-1] in (name, field.alias):
                return field.description or ""
    return ""


def fields_of(models: list[type[BaseModel]]) -> list[str]:
    """Return the fields that a file may give, those it has to first."""
    found = {
        field.alias or name: not field.is_required() for each in models for name, field in each.model_fields.items()
    }
    return sorted(found, key=lambda name: found[name])


def required_of(models: list[type[BaseModel]]) -> list[str]:
    """Return the fields that a file has to give."""
    required = (one.alias or name for each in models for name, one in each.model_fields.items() if one.is_required())
    return list(dict.fromkeys(required))


def _inside(here: list[Any], part: int | str) -> list[Any]:
    alternatives = [one for annotation in here for one in _alternatives(annotation)]
    if isinstance(part, int):
        return [inner for one in alternatives for inner in _entries(one, part)]
    fields = [
        field.annotation
        for one in alternatives
        if _is_model(one)
        for name, field in one.model_fields.items()
        if part in (name, field.alias)
    ]
    if fields:
        return fields
    values = [get_args(one)[1] for one in alternatives if get_origin(one) is dict]
    return values or alternatives  # a tag that chooses in a union, which is no part of the file


def _entries(annotation: Any, place: int) -> list[Any]:
    inner = [one for one in get_args(annotation) if one is not Ellipsis]
    if get_origin(annotation) is tuple and Ellipsis not in get_args(annotation):
        return inner[place : place + 1]
    return inner[:1] if get_origin(annotation) in (list, tuple) else []


def _alternatives(annotation: Any) -> list[Any]:
    """Return the kinds of a union, or the one; without what is only said of it."""
    if hasattr(annotation, "__metadata__"):
        return _alternatives(annotation.__origin__)
    if get_origin(annotation) in (Union, UnionType):
        return [found for part in get_args(annotation) for found in _alternatives(part)]
    return [annotation]


def _parts(annotation: Any) -> list[Any]:
    """Return every plain type in an annotation, however deep."""
    found: list[Any] = []
    for one in _alternatives(annotation):
        inner = get_args(one)
        found += [one] if not inner else [part for each in inner for part in _parts(each)]
    return found


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and get_origin(annotation) is None and issubclass(annotation, BaseModel)
