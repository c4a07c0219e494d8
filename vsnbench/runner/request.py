"""What `vsnbench run` was asked for: plain values, and what follows from them where nobody said."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vsnbench.lab_file import BUILT_IN_SITE
from vsnbench.models.remote.isolation import Isolation
from vsnbench.protocol.parameters import ProtocolParameters
from vsnbench.protocol.site import Site
from vsnbench.record.results import Kept, ResultsDirectory
from vsnbench.robots.registry import is_simulated
from vsnbench.runner.bench import BenchPlan
from vsnbench.runner.pool.capacity import WorkersAsked


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What `vsnbench run` was asked for, as it was typed."""

    model: str
    goals: tuple[str, ...]
    results: ResultsDirectory
    site: str = BUILT_IN_SITE
    robot: str = "simulated"
    starts: str | None = None
    repetitions: int = 1
    max_steps: int = 150
    seed: int = 0
    shuffle: bool = False
    noise: bool = False
    pretend_real: bool = False
    """A simulated robot plays a real one: a rehearsal."""
    model_options: Mapping[str, Any] = field(default_factory=dict)
    act_timeout_s: float | None = None
    """How long a model in this process may take for an action; without end when None."""
    isolation: Isolation | None = None
    """Run the model in a process of its own."""
    workers: WorkersAsked = field(default_factory=WorkersAsked)
    """How many trials are run at once in simulation, and where."""
    kept: Kept | None = None
    """What is kept of an episode beside its rows, where somebody said so."""
    attended: bool = False
    """Somebody stands beside the robot, though it may be simulated: one trial after another."""
    fail_fast: bool = False
    """The first void episode ends the session."""

    @property
    def keeps(self) -> Kept:
        """What is kept of an episode: as asked for, else Rerun's copies too where somebody stands beside the robot.

        In simulation with nobody there a copy is made when an episode is viewed, which few ever are.
        """
        if self.kept is not None:
            return self.kept
        somebody = self.attended or self.pretend_real or not is_simulated(self.robot)
        return Kept.FULL if somebody else Kept.LEAN

    def bench_plan(self, site: Site, parameters: ProtocolParameters) -> BenchPlan:
        """Return what every trial of it is run with."""
        return BenchPlan(
            site=site,
            model=self.model,
            goals=self.goals,
            robot=self.robot,
            noise=self.noise,
            pretend_real=self.pretend_real,
            parameters=parameters,
            model_options=self.model_options,
            act_timeout_s=self.act_timeout_s,
            isolation=self.isolation,
            kept=self.keeps,
        )
