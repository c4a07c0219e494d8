"""Goals of a site file beyond its categories, with what counts as reached; sequences of goals."""

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from vsnbench.settings.field_errors import FieldsError
from vsnbench.settings.yaml_file import DIRECTORY
from vsnbench.sites.categories import ALIASES, CATEGORIES, canonical_category
from vsnbench.sites.fields import Point, Slug, StrictModel, check_outline
from vsnbench.text.suggestions import closest
from vsnbench.values.encoding.images import MOST_PIXELS, decode_picture, picture_size
from vsnbench.values.goal import LEAST_PHOTOGRAPHS, GoalKind

MAX_IMAGE_BYTES = 5_000_000
"""Maximum size of the file of a photograph."""
MAX_TEXT = 2000
"""Maximum number of characters of a text or an instruction."""
LEAST_LEGS = 2
"""A sequence of one goal is that goal."""
MAX_ROUTE_MEGAPIXELS = 16
"""Maximum size of a route's photographs together, so that a message to a served model can hold them."""


class GoalImage(StrictModel):
    """Photograph of an image goal: a PNG or JPEG file."""

    file: str = Field(default="", description="path relative to the site file")
    sha256: str = Field(default="", pattern=r"^([0-9a-f]{64})?$")
    data: bytes | None = Field(default=None, exclude=True, repr=False)
    """Content of the file; None if only its hash is known."""

    @property
    def pixels(self) -> npt.NDArray[np.uint8] | None:
        """(H, W, 3) RGB, read-only; None if only the hash is known."""
        return None if self.data is None else _decoded(self.data)


@lru_cache(maxsize=8)
def _decoded(data: bytes) -> npt.NDArray[np.uint8] | None:
    import cv2

    bgr = decode_picture(data, cv2.IMREAD_COLOR)
    if bgr is None:
        return None
    rgb = np.ascontiguousarray(bgr[..., ::-1]).astype(np.uint8, copy=False)
    rgb.flags.writeable = False
    return rgb


def _read_image(value: Any, info: ValidationInfo) -> Any:
    """Read the file that a site file names; the directory of the site file is in the context."""
    directory = (info.context or {}).get(DIRECTORY)
    if isinstance(value, dict | GoalImage) and directory is None:  # of a record
        return value
    if not isinstance(value, str) or not value.strip():
        raise ValueError("expected the path of a PNG or JPEG file, relative to the site file")
    if directory is None:
        return GoalImage(file=value)
    return load_goal_image(Path(directory), value)


def goal_image(name: str, data: bytes) -> GoalImage:
    """Return the photograph in the content of a file.

    Raises:
        ValueError: the content is too large, or is not an image that can be decoded.
    """
    if len(data) > MAX_IMAGE_BYTES:
        raise ValueError(f"{name} is larger than {MAX_IMAGE_BYTES // 1_000_000} MB: scale it down")
    size = picture_size(data)
    if size is None:
        raise ValueError(f"{name} is not a PNG or JPEG image")
    if not 0 < size[0] * size[1] <= MOST_PIXELS:
        raise ValueError(f"{name} has {size[0]} x {size[1]} pixels; the limit is {MOST_PIXELS:,} in total")
    if _decoded(data) is None:
        raise ValueError(f"{name} is damaged: it cannot be decoded")
    return GoalImage(file=name, sha256=hashlib.sha256(data).hexdigest(), data=data)


def load_goal_image(directory: Path, name: str) -> GoalImage:
    """Read the photograph that a site file in a directory names.

    Raises:
        ValueError: the file is outside the directory, cannot be read, or is not such an image.
    """
    root = directory.resolve()
    try:
        path = (root / name).resolve()
        if not path.is_relative_to(root):
            raise ValueError(f"{name} is outside the directory of the site file: copy the image next to it")
        if not path.is_file():
            raise ValueError(f"{name} does not exist, or is not a file")
        with path.open("rb") as file:
            data = file.read(MAX_IMAGE_BYTES + 1)
    except OSError as problem:
        raise ValueError(f"cannot read {name}: {problem.strerror or problem}") from problem
    except RuntimeError as problem:
        raise ValueError(f"cannot read {name}: it is a link to itself") from problem
    return goal_image(name, data)


class GoalTarget(StrictModel):
    """What counts as reached: an object, all objects of a category, a point, or a region to enter."""

    object: str | None = Field(default=None, description="id of an object; its bare id means the same")
    category: str | None = Field(default=None, description="every object of this category")
    point: Point | None = Field(default=None, description="STOP near it and in sight of it succeeds, metres")
    region: list[Point] | None = Field(
        default=None, min_length=3, max_length=1000, description="STOP with the centre of the base inside it succeeds"
    )
    name: Slug | None = Field(default=None, description="name of a point or region in verdicts")

    _region_encloses = field_validator("region")(check_outline)

    @model_validator(mode="after")
    def _has_one_meaning(self) -> Self:
        given = [name for name in ("object", "category", "point", "region") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"a target is one of object, category, point or region; got {', '.join(given) or 'none'}")
        return self


_IMAGE = Annotated[GoalImage, BeforeValidator(_read_image)]
_DESCRIBED_BY = {
    GoalKind.CATEGORY: "category",
    GoalKind.TEXT: "text",
    GoalKind.IMAGE: "image",
    GoalKind.INSTRUCTION: "text",
    GoalKind.POINT: "targets",
    GoalKind.ROUTE: "images",
    GoalKind.SEQUENCE: "goals",
}


def _as_target(value: Any) -> Any:
    return {"object": value} if isinstance(value, str) else value


def _as_leg(value: Any) -> Any:
    if isinstance(value, dict | SiteGoal) or (isinstance(value, str) and _SLUG.fullmatch(value)):
        return value
    raise ValueError(f"{value!r} is neither the id of a goal nor a category")


_SLUG = re.compile(r"[a-z0-9][a-z0-9_-]{0,79}")


class SiteGoal(StrictModel):
    """A goal of a site, with what it tells a policy and what counts as reached."""

    id: Slug
    kind: GoalKind
    text: str = Field(default="", max_length=MAX_TEXT, description="the words of a text or an instruction")
    category: str = Field(default="", max_length=80, description="the category of a category goal")
    image: Annotated[GoalImage | None, BeforeValidator(_read_image)] = None
    images: list[_IMAGE] = Field(default=[], max_length=100, description="photographs of a route, in order")
    goals: list[Annotated["Slug | SiteGoal", BeforeValidator(_as_leg)]] = Field(
        default=[], max_length=100, description="goals of a sequence, in order: ids and categories"
    )
    targets: list[Annotated[GoalTarget, BeforeValidator(_as_target)]] = Field(default=[], max_length=1000)
    starts: list[int] = Field(
        default=[], max_length=9999, description="starting positions of its trials; default: all of the site"
    )

    @field_validator("id")
    @classmethod
    def _is_no_category(cls, name: str) -> str:
        if name in CATEGORIES or name.replace("-", "_") in ALIASES or name == "all":
            raise ValueError(
                f"{name!r} already names {'all goals' if name == 'all' else 'a category'}: give another id"
            )
        return name

    @field_validator("text")
    @classmethod
    def _is_printable(cls, text: str) -> str:
        words = " ".join(text.split())
        if not words.isprintable():
            raise ValueError("the text has characters that cannot be printed")
        return words

    @model_validator(mode="after")
    def _describes_its_kind(self) -> Self:
        required = _DESCRIBED_BY[self.kind]
        if not getattr(self, required):
            raise ValueError(f"a goal of kind {self.kind} needs the field {required}")
        for name in ("text", "category", "image", "images", "goals"):
            if name != required and getattr(self, name):
                raise ValueError(f"a goal of kind {self.kind} has no field {name}: it is described by {required}")
        if self.kind is GoalKind.POINT and [target.point is not None for target in self.targets] != [True]:
            raise ValueError("a goal of kind point has one target, a point: targets: [{point: [3.2, 1.1]}]")
        if self.kind is GoalKind.ROUTE:
            self._check_photographs()
        if self.kind is GoalKind.SEQUENCE:
            self._check_sequence()
        if self.kind is GoalKind.INSTRUCTION and not self.starts:
            raise ValueError("an instruction needs starts: the starting positions from which it holds")
        if not self.targets and self.kind not in (GoalKind.CATEGORY, GoalKind.SEQUENCE):
            raise ValueError("targets is empty: name what counts as reached, such as an object's id")
        if len(set(self.starts)) != len(self.starts):
            raise ValueError("a starting position is listed twice in starts")
        return self

    def _check_photographs(self) -> None:
        if len(self.images) < LEAST_PHOTOGRAPHS:
            raise ValueError("images has one photograph: a route has two or more; for one, write kind: image")
        millions = sum(image.pixels.size // 3 for image in self.images if image.pixels is not None) / 1e6
        if millions > MAX_ROUTE_MEGAPIXELS:
            raise ValueError(
                f"images have {millions:.1f} million pixels together: scale them down to {MAX_ROUTE_MEGAPIXELS} million"
            )

    def _check_sequence(self) -> None:
        if self.targets:
            raise ValueError("a sequence has no targets: each of its goals has its own")
        if len(self.goals) < LEAST_LEGS:
            raise ValueError("goals has one goal: a sequence has two or more")
        if self.id in {goal.id if isinstance(goal, SiteGoal) else goal for goal in self.goals}:
            raise ValueError(f"goals has {self.id!r}, the sequence itself: remove it")

    @property
    def legs(self) -> tuple[str, ...]:
        """Names of the goals to give one after the other: those of a sequence, or its own."""
        if self.kind is not GoalKind.SEQUENCE:
            return (self.id,)
        return tuple(goal.id if isinstance(goal, SiteGoal) else canonical_category(goal) for goal in self.goals)

    @property
    def parts(self) -> "tuple[SiteGoal, ...]":
        """Definitions of the goals of a sequence that are not plain categories; empty for another kind."""
        return tuple(goal for goal in self.goals if isinstance(goal, SiteGoal))

    @property
    def meant(self) -> list[GoalTarget]:
        """The targets; all objects of the category if a category goal lists none; none for a sequence."""
        if self.kind is GoalKind.SEQUENCE:
            return []
        return self.targets or [GoalTarget(category=canonical_category(self.category))]

    def with_parts(self, others: "Mapping[str, SiteGoal]") -> "SiteGoal":
        """Return a sequence with the definitions of its goals, so that its hash and its record have them."""
        goals = [goal if isinstance(goal, SiteGoal) else others.get(goal, goal) for goal in self.goals]
        return self.model_copy(update={"goals": goals})

    def content(self) -> dict[str, Any]:
        """Return the definition as plain JSON values: what the record stores, and what is hashed."""
        content: dict[str, Any] = {"id": self.id, "kind": self.kind.value}
        for name in ("text", "category"):
            if value := getattr(self, name):
                content[name] = value
        if self.image is not None:
            content["image"] = {"sha256": self.image.sha256}
        if self.images:
            content["images"] = [{"sha256": image.sha256} for image in self.images]
        if self.goals:
            content["goals"] = [goal.content() if isinstance(goal, SiteGoal) else goal for goal in self.goals]
        content["targets"] = [target.model_dump(mode="json", exclude_none=True) for target in self.targets]
        if self.starts:
            content["starts"] = sorted(self.starts)
        return content

    @cached_property
    def sha256(self) -> str:
        """Hash of the definition; the photograph counts by its content, not by its file's name."""
        return hashlib.sha256(json.dumps(self.content(), sort_keys=True).encode()).hexdigest()


def check_references(goals: Collection[SiteGoal], site: Any) -> None:
    """Check that targets, starts and goals of sequences exist, and that no point is in a wall.

    Args:
        goals: the goals.
        site: their `Site`, whose module imports this one.

    Raises:
        FieldsError: some do not.
    """
    objects, categories = [thing.id for thing in site.objects], site.categories
    starts = {start.number for start in site.starts}
    errors: list[tuple[tuple[int | str, ...], str]] = []
    for number, goal in enumerate(goals):
        if goal.id in categories:
            errors.append((("goals", number, "id"), f"the site has a category {goal.id!r}: give another id"))
        for place, target in enumerate(goal.meant):
            where = ("goals", number, "targets", place) if goal.targets else ("goals", number, "category")
            if target.object is not None and target.object not in objects:
                near = closest(target.object, objects)
                hint = f"did you mean {near!r}?" if near else "targets are ids of objects"
                errors.append((where, f"target {target.object!r} is not an object of the site: {hint}"))
            if target.category is not None and canonical_category(target.category) not in categories:
                near = closest(target.category, categories)
                hint = f": did you mean {near!r}?" if near else ""
                errors.append((where, f"the site has no object of category {target.category!r}{hint}"))
            if goal.kind is GoalKind.POINT and target.point is not None and _is_in_wall(site, target.point):
                x_m, y_m = target.point
                errors.append((where, f"point [{x_m:g}, {y_m:g}] is in a wall: move it to where a robot can stand"))
        for place, leg in enumerate(goal.goals):
            if problem := _problem_of_leg(leg, categories, [other.id for other in goals]):
                errors.append((("goals", number, "goals", place), problem))
        if missing := [start for start in goal.starts if start not in starts]:
            errors.append((("goals", number, "starts"), f"the site has no starting position {missing[0]}"))
    if errors:
        raise FieldsError(errors)


def _is_in_wall(site: Any, point: Point) -> bool:
    from shapely.geometry import Point as ShapelyPoint

    there = ShapelyPoint(point)
    openings = (door.opening for door in site.doors if not door.closed)
    in_opening = any(opening.covers(there) for opening in openings)
    return not in_opening and any(wall.shape.covers(there) for wall in site.walls)


def _problem_of_leg(leg: str | SiteGoal, categories: Collection[str], ids: Iterable[str]) -> str:
    if isinstance(leg, SiteGoal):
        return f"{leg.id!r} is a sequence: list its goals instead" if leg.kind is GoalKind.SEQUENCE else ""
    if canonical_category(leg) in categories:
        return ""
    near = closest(leg, [*ids, *categories])
    return f"{leg!r} is neither a goal nor a category of the site" + (f": did you mean {near!r}?" if near else "")
