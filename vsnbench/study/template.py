"""Template of `vsnbench study new`: a study file with a comment on every field."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

TEMPLATE = """\
# Plan of a study: models, trials, order, analysis. Complete it before the first trial.
#   vsnbench study check {file}     check that the plan is complete and consistent
#   vsnbench study plan {file}      compute the power and the duration of the design
#   vsnbench study lock {file}      lock the plan; later changes are amendments
#   vsnbench study run {file}       run the study, or continue it
#   vsnbench study report {file}

title: {title}          # shown to operators: do not name models
question: {question}

site: {site}            # embedded site, or path of a site file
robot: {robot}
# noise: true           # noisy depth and odometry, in simulation
{rehearsal}rehearse: true        # a rehearsal: a simulated robot that the operator places and judges

arms:                   # two to twelve: a name, and a value of --model
{arms}
    # weights: il.ckpt  # or `embedded`; also config: settings.yaml, device: cpu, act_timeout: 10
    # goals: [monitor]  # additional goals of this arm: run but not compared

goals: [{goals}]        # shared goals, which are compared
{starts}      # default: all of the site
repetitions: {repetitions}
{twin}                  # cells with real trials, drawn at random; simulated trials, run before, predict the others
# protocol: ros4vsn     # name of `vsnbench protocol list`, or parameters: {{max_actions: 100}}

order: blocks           # every arm once per cell, in random order; or shuffled, or as-planned (arm by arm)
seed: {seed}            # determines schedule, codes and trials
blind: {blind}          # show codes until `vsnbench study unblind`

primary: {primary}   # difference: in success, all pairs of arms; metric: progress for progress; or
                              # {{kind: rate, arm: NAME, rate: 0.5}}, {{kind: equivalence}} up to the margin, or
                              # {{kind: non-inferiority, arm: NAME}}
stopping: {stopping}          # plan: all trials; decided: until the primary analysis is decided
{test}sign-flips       # rule of decided: exact tests of starting positions at the looks
# looks: [8, 11, 15]    # complete positions at which decided is analysed; default: about half, 3/4 and all
alpha: 0.05             # family-wise error rate over all pairs
margin: 0.0             # difference that a winner must exceed; of equivalence, the one not to be reached
difference: 0.15        # true difference for `vsnbench study plan`
power: 0.8              # desired power for `vsnbench study plan`

operators: [{operators}]
notes: ""
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyDraft:
    """Content of a new study file."""

    title: str
    question: str
    arms: Mapping[str, str]
    """Name -> model."""
    goals: Sequence[str]
    """Shared goals."""
    site: str = "apartment"
    """Name or path."""
    robot: str = "simulated"
    """Value of `--robot`."""
    starts: str = ""
    """Starting positions such as 1-15,20; all if empty."""
    repetitions: int = 1
    """Trials per cell."""
    seed: int = 0
    blind: bool = True
    """Show codes instead of names."""
    stopping: str = "plan"
    """`plan` or `decided`."""
    operators: Sequence[str] = ()
    real_cells: int | None = None
    """Number of cells with real trials, of a planned twin; its primary analysis is the first arm's rate."""
    rehearse: bool = False
    """The operator places and judges a simulated robot."""

    def text(self, file: str) -> str:
        """Return the text of the study file; its comments contain the name of the file."""
        return TEMPLATE.format(
            file=file,
            title=_quoted(self.title),
            question=_quoted(self.question),
            arms="\n".join(f"  {name}:\n    model: {_quoted(model)}" for name, model in self.arms.items()),
            goals=", ".join(self.goals),
            site=_quoted(self.site),
            robot=_quoted(self.robot),
            starts=f"starting_positions: {_quoted(self.starts)}" if self.starts else '# starting_positions: "1-15"',
            repetitions=self.repetitions,
            twin="# real_cells: 30" if self.real_cells is None else f"real_cells: {self.real_cells}",
            primary="{kind: difference}"
            if self.real_cells is None
            else f"{{kind: rate, arm: {next(iter(self.arms))}, rate: 0.5}}",
            seed=self.seed,
            rehearsal="" if self.rehearse else "# ",
            blind=str(self.blind).lower(),
            stopping=self.stopping,
            test="test: " if self.stopping == "decided" else "# test: ",
            operators=", ".join(_quoted(name) for name in self.operators),
        )


def _quoted(text: str) -> str:
    """Return text as a quoted YAML string."""
    return json.dumps(text, ensure_ascii=False)
