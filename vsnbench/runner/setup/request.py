"""Request of `vsnbench run`: its options as plain values, and the defaults that depend on others."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from vsnbench.config import BUILT_IN_SITE
from vsnbench.models.fit.camera import Fit
from vsnbench.models.names import is_address, is_third_party
from vsnbench.models.registry import keywords_of, locate
from vsnbench.models.remote.isolation import Isolation
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.results.files.directory import KeepFiles, ResultsDirectory
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.executors.capacity import WorkerOptions
from vsnbench.runner.setup.trial_setup import TrialSetupSpec
from vsnbench.sites.site import Site


@dataclass(frozen=True, slots=True)
class RunRequest:
    """Options of `vsnbench run`."""

    model: str
    goals: tuple[str, ...]
    results: ResultsDirectory
    site: str = BUILT_IN_SITE
    robot: str = "simulated"
    starts: str | None = None
    repetitions: int = 1
    parameters: ProtocolParameters = field(default_factory=ProtocolParameters)
    seed: int = 0
    noise: bool = False
    disturbances: Disturbances = NONE
    """Disturbances of what the model sees."""
    rehearsal: bool = False
    """A rehearsal: a simulated robot is treated as a real one."""
    fit: Fit = Fit.FULL
    """Images that the model receives: the robot's, or cropped to the trained field of view."""
    model_options: Mapping[str, Any] = field(default_factory=dict)
    act_timeout_s: float | None = None
    """Time limit for an action; None for 10 s with a remote model and no limit otherwise."""
    device: str | None = None
    """Device for a model that has one and no other in its options; None for the model's default."""
    isolation: Isolation | None = None
    """Runs the model in a separate process."""
    workers: WorkerOptions = field(default_factory=WorkerOptions)
    """Number of trials that run at once in simulation, and where."""
    keep: KeepFiles | None = None
    """What to store of an episode in addition to its rows; None chooses."""
    attended: bool = False
    """An operator is present, even if the robot is simulated; trials run one at a time."""
    skips_absent_goals: bool = False
    """Goals that the site lacks are skipped, not refused."""
    fail_fast: bool = False
    """The first void episode ends the session."""

    @property
    def label(self) -> str:
        """Model, site, seed and disturbances, for messages about one of several campaigns."""
        disturbed = f", {self.disturbances.text}" if self.disturbances else ""
        return f"{self.model} in {self.site} with seed {self.seed}{disturbed}"

    @property
    def files_to_keep(self) -> KeepFiles:
        """What to store of an episode: as requested, or copies for Rerun only where an operator is present.

        An unattended simulation makes a copy when an episode is viewed.
        """
        if self.keep is not None:
            return self.keep
        has_operator = self.attended or self.rehearsal or not is_simulated(self.robot)
        return KeepFiles.ALL if has_operator else KeepFiles.IMAGES

    def setup_spec(self, site: Site) -> TrialSetupSpec:
        """Return the setup of every trial."""
        is_remote = self.isolation is not None or is_address(self.model)
        remote_options = {"act_timeout": self.act_timeout_s} if is_remote and self.act_timeout_s is not None else {}
        spec = TrialSetupSpec(
            site=site,
            model=self.model,
            goals=self.goals,
            robot=self.robot,
            noise=self.noise,
            rehearsal=self.rehearsal,
            disturbances=self.disturbances,
            parameters=self.parameters,
            model_options={**self.model_options, **remote_options},
            act_timeout_s=None if is_remote else self.act_timeout_s,
            isolation=self.isolation,
            fit=self.fit,
            keep=self.files_to_keep,
        )
        if self.device is None or not self._model_takes_device(spec):
            return spec
        return replace(spec, model_options={"device": self.device, **spec.model_options})

    def _model_takes_device(self, spec: TrialSetupSpec) -> bool:
        """Return whether the model has a device. Of isolated models, only the package's own are known here."""
        if self.isolation is None:
            return spec.model_takes("device")
        own = self.isolation.python is None and not is_third_party(self.model)
        return own and "device" in keywords_of(locate(self.model)[1])
