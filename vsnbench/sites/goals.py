"""Goals of a site file beyond its categories: free words, photographs and instructions, with what counts as reached."""

import hashlib
import json
from collections.abc import Iterable
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
from vsnbench.values.goal import GoalKind

MAX_IMAGE_BYTES = 5_000_000
"""Maximum size of the file of a photograph."""
MAX_TEXT = 2000
"""Maximum number of characters of a text or an instruction."""


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


def _as_target(value: Any) -> Any:
    return {"object": value} if isinstance(value, str) else value


class SiteGoal(StrictModel):
    """A goal of a site, with what it tells a policy and what counts as reached."""

    id: Slug
    kind: GoalKind
    text: str = Field(default="", max_length=MAX_TEXT, description="the words of a text or an instruction")
    category: str = Field(default="", max_length=80, description="the category of a category goal")
    image: Annotated[GoalImage | None, BeforeValidator(_read_image)] = None
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
        required = {
            GoalKind.CATEGORY: "category",
            GoalKind.TEXT: "text",
            GoalKind.IMAGE: "image",
            GoalKind.INSTRUCTION: "text",
        }[self.kind]
        if not getattr(self, required):
            raise ValueError(f"a goal of kind {self.kind} needs the field {required}")
        for name in ("text", "category", "image"):
            if name != required and getattr(self, name):
                raise ValueError(f"a goal of kind {self.kind} has no field {name}: it is described by {required}")
        if self.kind is GoalKind.INSTRUCTION and not self.starts:
            raise ValueError("an instruction needs starts: the starting positions from which it holds")
        if not self.targets and self.kind is not GoalKind.CATEGORY:
            raise ValueError("targets is empty: name what counts as reached, such as an object's id")
        if len(set(self.starts)) != len(self.starts):
            raise ValueError("a starting position is listed twice in starts")
        return self

    @property
    def meant(self) -> list[GoalTarget]:
        """The targets; all objects of the category if a category goal lists none."""
        return self.targets or [GoalTarget(category=canonical_category(self.category))]

    def content(self) -> dict[str, Any]:
        """Return the definition as plain JSON values: what the record stores, and what is hashed."""
        content: dict[str, Any] = {"id": self.id, "kind": self.kind.value}
        for name in ("text", "category"):
            if value := getattr(self, name):
                content[name] = value
        if self.image is not None:
            content["image"] = {"sha256": self.image.sha256}
        content["targets"] = [target.model_dump(mode="json", exclude_none=True) for target in self.targets]
        if self.starts:
            content["starts"] = sorted(self.starts)
        return content

    @cached_property
    def sha256(self) -> str:
        """Hash of the definition; the photograph counts by its content, not by its file's name."""
        return hashlib.sha256(json.dumps(self.content(), sort_keys=True).encode()).hexdigest()


def check_references(
    goals: Iterable[SiteGoal], objects: Iterable[str], categories: Iterable[str], starts: Iterable[int]
) -> None:
    """Check that targets and starts of goals exist.

    Raises:
        FieldsError: some do not.
    """
    objects, categories, starts = list(objects), set(categories), set(starts)
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
        if missing := [start for start in goal.starts if start not in starts]:
            errors.append((("goals", number, "starts"), f"the site has no starting position {missing[0]}"))
    if errors:
        raise FieldsError(errors)
