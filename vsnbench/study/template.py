"""What `vsnbench study new` writes: a whole study file with a comment on every field."""

import json
from collections.abc import Mapping, Sequence

TEMPLATE = """\
# A study: what is compared, on what, in which order, judged how. Say everything here before the first trial.
#   vsnbench study check {file}     is everything there, does it fit together?
#   vsnbench study plan {file}      what can this design show, and how long does it take?
#   vsnbench study lock {file}      freeze it; from then on a change is an amendment
#   vsnbench study run {file}       run it; the same command goes on
#   vsnbench study report {file}

title: {title}          # operators see it: name no model in it
question: {question}

site: {site}            # an embedded site, or the path of a site file
robot: {robot}
# noise: true           # noisy depth and odometry, in simulation
{rehearsal}pretend_real: true    # a rehearsal: a simulated robot that a person must place and judge

arms:                   # two to twelve: a name of yours, and what --model takes
{arms}
    # weights: il.ckpt  # or `embedded`; also config: settings.yaml, device: cpu, act_timeout: 10
    # goals: [monitor]  # goals of one arm alone: run, and never compared

goals: [{goals}]        # the shared goals: those that are compared
{starts}      # all of the site's where this is left out
repetitions: {repetitions}
# protocol: {{max_actions: 150}}

order: blocks           # every arm once on one cell, all in random order; or shuffled, or as-planned (arm by arm)
seed: {seed}            # schedule, codes and every trial follow from it
blind: {blind}          # people see codes until `vsnbench study unblind`

primary: {{kind: difference}}   # of success, every pair of arms; or {{kind: rate, arm: NAME, rate: 0.5}}
stopping: {stopping}          # when every trial is done; or `decided`: as soon as the primary analysis is
{about}cells-like-these     # for decided: what it speaks of; these-cells needs fewer trials, and speaks of no others
alpha: 0.05             # chance of a false conclusion, all pairs together
margin: 0.0             # a winner must be better by more than this share of trials
difference: 0.15        # the difference that you want to find (for `vsnbench study plan`)
power: 0.8              # and how surely

operators: [{operators}]
notes: ""
"""


def study_text(
    *,
    file: str,
    title: str,
    question: str,
    arms: Mapping[str, str],
    goals: Sequence[str],
    site: str = "apartment",
    robot: str = "simulated",
    starts: str = "",
    repetitions: int = 1,
    seed: int = 0,
    blind: bool = True,
    stopping: str = "plan",
    operators: Sequence[str] = (),
    pretend_real: bool = False,
) -> str:
    """Return the text of a new study file.

    Args:
        file: its name, for the comments.
        title: a line.
        question: what it is to answer.
        arms: name -> model.
        goals: the shared ones.
        site: where.
        robot: which.
        starts: like 1-15,20; all of the site's when empty.
        repetitions: of each cell.
        seed: of everything.
        blind: whether people see codes.
        stopping: `plan` or `decided`.
        operators: who runs it.
        pretend_real: whether a simulated robot is to be placed and judged by a person.
    """
    return TEMPLATE.format(
        file=file,
        title=_quoted(title),
        question=_quoted(question),
        arms="\n".join(f"  {name}:\n    model: {_quoted(model)}" for name, model in arms.items()),
        goals=", ".join(goals),
        site=_quoted(site),
        robot=_quoted(robot),
        starts=f"starting_positions: {_quoted(starts)}" if starts else '# starting_positions: "1-15"',
        repetitions=repetitions,
        seed=seed,
        rehearsal="" if pretend_real else "# ",
        blind=str(blind).lower(),
        stopping=stopping,
        about="about: " if stopping == "decided" else "# about: ",
        operators=", ".join(_quoted(name) for name in operators),
    )


def _quoted(text: str) -> str:
    """Return text as YAML that is read back as it is, whatever it holds."""
    return json.dumps(text, ensure_ascii=False)
