"""What every target of the fuzzing is."""

import random
from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar, Protocol

from tests.fuzz import mutations


class Target(Protocol):
    """A loader; made once in a folder of its own."""

    def __init__(self, home: Path) -> None: ...

    def load(self, rng: random.Random, index: int | None) -> None:
        """Spoil a good input and load it; None for `index` loads it as it is."""


class SettingsFile(ABC):
    """A YAML file behind a function that reads it."""

    files: ClassVar[tuple[Path | str, ...]]

    def __init__(self, home: Path) -> None:
        self.path = home / "given.yaml"
        self.good = [file.encode() if isinstance(file, str) else file.read_bytes() for file in self.files]

    def load(self, rng: random.Random, index: int | None) -> None:
        good = rng.choice(self.good)
        self.path.write_bytes(good if index is None else mutations.yaml_text(rng, good))
        self.read()

    @abstractmethod
    def read(self) -> None:
        """Have the project read the file."""
