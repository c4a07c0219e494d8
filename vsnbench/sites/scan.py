"""The scan that a site file names: a file of triangles and textures, known by its hash."""

import hashlib
import json
from pathlib import Path
from typing import Any, Final, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from vsnbench.settings.yaml_file import DIRECTORY
from vsnbench.sites.fields import StrictModel

SCAN_SUFFIX: Final = ".scan.npz"
"""End of the name of a scan's file, next to its site file."""


class SiteScan(StrictModel):
    """Scan of the place, in the site's frame; `vsnbench sites scan` writes its file."""

    file: str = Field(default="", max_length=500, description="path relative to the site file")
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$", description="hash of the file")
    path: Path | None = Field(default=None, exclude=True, repr=False)
    """The file; None in a record, which has only the hash."""

    @field_validator("path", mode="before")
    @classmethod
    def _is_not_given(cls, path: Any) -> Any:
        if path is not None and not isinstance(path, Path):
            raise ValueError("path is not a field of a site file: name the scan in the field file")
        return path

    @model_validator(mode="after")
    def _is_next_to_the_site_file(self, info: ValidationInfo) -> Self:
        directory = (info.context or {}).get(DIRECTORY)
        if directory is None:
            return self
        if not self.file:
            raise ValueError("a scan needs the field file")
        try:
            root = Path(directory).resolve()
            path = (root / self.file).resolve()
            if not path.is_relative_to(root):
                raise ValueError(f"{self.file} is outside the directory of the site file: copy the scan next to it")
            if not path.is_file():
                raise ValueError(f"{self.file} does not exist, or is not a file: copy the scan next to the site file")
        except OSError as problem:
            raise ValueError(f"cannot read {self.file}: {problem.strerror or problem}") from problem
        except RuntimeError as problem:
            raise ValueError(f"cannot read {self.file}: it is a link to itself") from problem
        object.__setattr__(self, "path", path)
        return self


def content_sha256(content: dict[str, Any]) -> str:
    """Return the hash of a site's content."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def survey_sha256(content: dict[str, Any]) -> str:
    """Return the hash of a site's content without its scan: that of the same site with a drawn twin."""
    return content_sha256({name: value for name, value in content.items() if name != "scan"})
