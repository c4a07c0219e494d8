"""Settings of a training run; their hash identifies the data and the result."""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator

from vsnbench.errors import UsageError
from vsnbench.models.pirlnav.architecture import Architecture
from vsnbench.models.pirlnav.policy import ACTIONS, GOALS
from vsnbench.settings.yaml_file import read_settings
from vsnbench.simulator.generated_sites.generate import SEEDS, Split
from vsnbench.values.camera import Camera

Span = tuple[float, float]
Count = Annotated[int, Field(ge=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NetworkSizes(_Strict):
    """Sizes of the PIRLNav network."""

    image_size_px: int = Field(default=96, multiple_of=32, ge=32, le=256)
    base_planes: int = Field(default=12, multiple_of=2, ge=2, le=32)
    visual_size: Count = 256
    hidden_size: Count = 384
    recurrent_layers: Count = 2

    @property
    def architecture(self) -> Architecture:
        """The network for imitation, without a critic."""
        return Architecture(**self.model_dump(), actions=len(ACTIONS), goals=len(GOALS), critic=False)


class Demonstrations(_Strict):
    """Data of one round; a shard is one site with one camera."""

    flats: Count = Field(default=220, description="shards of the first round")
    dagger_flats: int = Field(default=50, ge=0, description="shards of each later round")
    dagger_rounds: int = Field(default=2, ge=0)
    episodes: Count = Field(default=24, description="per shard of the first round")
    dagger_episodes: Count = Field(default=24, description="per shard of a later round")
    goals: tuple[str, ...] = Field(
        default=tuple(GOALS), min_length=1, description="goals of a shard's episodes, in turn; repeat a goal for more"
    )
    lanes: Count = Field(default=24, description="number of parallel episodes of a shard")
    max_actions: Count = 150
    perturbed_share: float = Field(default=0.06, ge=0, le=1, description="chance per step to begin random actions")
    perturbed_actions: Count = Field(default=4, description="maximum number of consecutive random actions")
    student_actions: Count = Field(default=10, description="maximum number of consecutive actions of a student")
    expert_actions: Count = Field(default=15, description="maximum number of consecutive actions of the demonstrator")
    mount_height_m: Span = (0.5, 0.75)
    tilt_deg: Span = (-5.0, 5.0)
    horizontal_fov_deg: Span = (55.0, 68.0)
    jpeg_quality: int = Field(default=95, ge=50, le=100)

    @field_validator("goals")
    @classmethod
    def _goals_are_known(cls, goals: tuple[str, ...]) -> tuple[str, ...]:
        if unknown := sorted({*goals} - {*GOALS}):
            raise ValueError(f"{', '.join(unknown)}: the goals are {', '.join(GOALS)}")
        return goals

    def varied(self, camera: Camera, seed: int) -> Camera:
        """Return a camera with the mount height, tilt and field of view of a site's seed."""
        rng = np.random.default_rng([seed, 0xCA])
        return camera.model_copy(
            update={
                "mount_height_m": round(float(rng.uniform(*self.mount_height_m)), 3),
                "tilt_deg": round(float(rng.uniform(*self.tilt_deg)), 2),
                "horizontal_fov_deg": round(float(rng.uniform(*self.horizontal_fov_deg)), 2),
            }
        )


class Seeing(_Strict):
    """Training of the image encoder on single frames: objects in view, their distance, and the free distance."""

    updates: Count = 5000
    batch: Count = 64
    learning_rate: float = Field(default=1e-3, gt=0)


class Cloning(_Strict):
    """Behaviour cloning of one round: truncated back-propagation through time over lanes of whole episodes."""

    updates: tuple[Count, ...] = Field(
        default=(2000, 1000, 2200), min_length=1, description="number of updates in each round"
    )
    lanes: Count = 32
    steps: Count = Field(default=48, description="steps between two cuts of the gradient")
    learning_rate: float = Field(default=6e-4, gt=0)
    largest_gradient: float = Field(default=1.0, gt=0)
    least_inflection_weight: float = Field(
        default=1.0, ge=0, description="lower limit of the weight, which is otherwise the ratio in the data"
    )


class Validation(_Strict):
    """Episodes on validation sites, without physics."""

    flats: Count = 3
    episodes: Count = 24
    every_updates: Count = 1000


class Calibration(_Strict):
    """Bias of STOP's logit, chosen on validation sites of its own.

    Inflection weighting increases the probability of STOP, which is always a change of action, by the weight. Sampled
    at every step, STOP would come too early.
    """

    stop_biases: tuple[float, ...] = Field(default=(0.0, -1.0, -2.0, -2.5, -3.0, -3.5, -4.0), min_length=1)
    flats: Count = 4
    episodes: Count = 24


class Recipe(_Strict):
    """One training run."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")
    start: Path | None = Field(default=None, description="PIRLNav checkpoint to continue from; none begins untrained")
    start_sha256: str = Field(default="", pattern="^([0-9a-f]{64})?$", description="hash of that file")
    seed: int = Field(default=0, ge=0)
    network: NetworkSizes = NetworkSizes()
    demonstrations: Demonstrations = Demonstrations()
    seeing: Seeing = Seeing()
    cloning: Cloning = Cloning()
    validation: Validation = Validation()
    calibration: Calibration = Calibration()
    save_every_updates: Count = 200
    profile: str = "turtlebot2"

    @property
    def sha256(self) -> str:
        """Hash of the content."""
        return hashlib.sha256(json.dumps(self.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()

    def demonstrations_of(self, round_number: int) -> Demonstrations:
        """Return the data settings of a round."""
        plan = self.demonstrations
        if round_number == 0:
            return plan
        return plan.model_copy(update={"episodes": plan.dagger_episodes, "perturbed_share": 0.0})

    def cloning_updates(self, round_number: int) -> int:
        """Return the cloning settings of a round; later rounds use the last ones."""
        updates = self.cloning.updates
        return updates[min(round_number, len(updates) - 1)]

    def training_seeds(self, round_number: int) -> range:
        """Return the sites of a round; rounds do not share sites with each other, validation or test."""
        plan = self.demonstrations
        first = SEEDS[Split.TRAINING].start + 10_000 * self.seed
        first += 0 if round_number == 0 else plan.flats + (round_number - 1) * plan.dagger_flats
        seeds = range(first, first + (plan.flats if round_number == 0 else plan.dagger_flats))
        if seeds and seeds[-1] not in SEEDS[Split.TRAINING]:
            raise UsageError(f"recipe {self.name}: seed {self.seed} leads outside the training split")
        return seeds

    @property
    def validation_seeds(self) -> range:
        """Sites that measure success between rounds."""
        return SEEDS[Split.VALIDATION][: self.validation.flats]

    @property
    def calibration_seeds(self) -> range:
        """Sites for the choice of STOP's bias."""
        first = self.validation.flats
        return SEEDS[Split.VALIDATION][first : first + self.calibration.flats]


RECIPES: Final = Path(__file__).parent / "recipes"


def load_recipe(name_or_path: str) -> Recipe:
    """Read a recipe by name or path.

    Raises:
        UsageError: the recipe does not exist or breaks the format.
    """
    ours = RECIPES / f"{name_or_path}.yaml"
    return read_settings(ours if ours.is_file() else Path(name_or_path), Recipe, UsageError, "recipe")
