"""`vsnbench try`: check a policy, run two simulated trials, and say what a person would see."""

import shlex
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support import trial_options as trial
from vsnbench.cli.support.options import (
    Protocol,
    configured_option,
    of_models,
    record_option,
    results_directory,
    what_to_keep,
)
from vsnbench.cli.support.output import Json, print_json, without_prints_of_models
from vsnbench.cli.support.progress import ProgressBars
from vsnbench.config import BUILT_IN_PROTOCOL, BUILT_IN_ROBOT, BUILT_IN_SITE, load_config
from vsnbench.text.sanitize import sanitize

if TYPE_CHECKING:
    from vsnbench.models.contract_check import ContractFinding
    from vsnbench.report.diagnosis import EpisodeDiagnosis
    from vsnbench.results.model import EpisodeRecord
    from vsnbench.runner.setup.request import RunRequest

_WIDTH, _LABEL = 80, 9
_MOST_REASONS = 3
"""Reasons of failed checks that are listed."""
_CHECKS = 11
"""Number of checks, for the display."""


def command(  # noqa: PLR0913 - Typer needs a parameter per option
    policy: Annotated[
        str,
        typer.Argument(metavar="POLICY", help="FILE.py or package.module, with :Class if it has several; or a model."),
    ],
    goal: Annotated[
        list[str] | None,
        trial.trials_option(
            "--goal",
            "-g",
            metavar="A,B",
            show_default="the first that the model takes",
            help="Categories or goals of the site.",
        ),
    ] = None,
    site: Annotated[
        str,
        configured_option("site", help="Embedded site, site file, or flat:7 (generated).", rich_help_panel="Trials"),
    ] = BUILT_IN_SITE,
    robot: Annotated[
        str, configured_option("robot", "-r", help="Robot or profile to simulate.", rich_help_panel="Trials")
    ] = BUILT_IN_ROBOT,
    starts: Annotated[
        list[str] | None,
        trial.trials_option(
            "--starts", metavar="N,N-M", show_default="the first two", help="Starting positions, like 3,7."
        ),
    ] = None,
    protocol: Protocol = BUILT_IN_PROTOCOL,
    weights: trial.Weights = None,
    model_config: trial.ModelConfig = None,
    results: Annotated[
        Path | None,
        record_option("--results", help="Results directory that keeps the trials. Default: a temporary one."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a policy, run two simulated trials with it, and say in ten lines what it did and what is wrong.

    The check is that of `vsnbench models check`, the trials are those of `vsnbench run`; for a slow model both are
    shorter. Without --results, the results are temporary: the next `vsnbench try` removes them.
    The exit code is 1 if a check fails or a trial is void, and 0 if the model merely misses its goal.

    [bold]Examples[/bold]

        vsnbench try walker.py
        vsnbench try walker.py:Walker --goal bed --starts 3,7
        vsnbench try mylab.policy
        vsnbench try pirlnav --weights il.ckpt --results results
    """
    from vsnbench.cli.running.summary import run_and_exit, summary_console
    from vsnbench.files.temporary import ScratchDirectory
    from vsnbench.models.policy_file import policy_name
    from vsnbench.protocol.named import load_protocol
    from vsnbench.results.files.directory import ResultsDirectory
    from vsnbench.robots.registry import is_simulated
    from vsnbench.runner.setup.request import RunRequest
    from vsnbench.runner.setup.selection import choose_starts, named_site, resolve_goals
    from vsnbench.runner.setup.trial_setup import TrialSetupSpec

    with without_prints_of_models(as_json=as_json):
        name, root = policy_name(policy)
    used_site, config = named_site(site), load_config()
    simulated = robot if is_simulated(robot) else f"simulated:{robot}"
    # Its lock ends with this process, so that the directory stays until the next one with this purpose is made.
    directory = ResultsDirectory.locate(ScratchDirectory("try").path / "results") if results is None else None
    request = RunRequest(
        setup=TrialSetupSpec(
            site=used_site,
            model=name,
            goals=resolve_goals(goal, used_site) if goal else (),
            robot=simulated,
            parameters=load_protocol(protocol),
            model_options=trial.model_options(weights, model_config),
            **of_models(config),
            keep=what_to_keep("", simulated),
        ),
        results=directory or results_directory(results, None),
        site=site,
        starts=choose_starts(",".join(starts), used_site) if starts else (),
        fail_fast=True,
    )
    run_and_exit(summary_console(), _try, request, root, as_json=as_json)


def _try(request: "RunRequest", root: Path | None, *, as_json: bool) -> int:
    """Run the check and the trials, print what was found, and return the exit code."""
    from vsnbench.models.contract_check import ContractFinding, check_policy
    from vsnbench.report.diagnosis import advice, as_fields, diagnose
    from vsnbench.results.reading.filtering import EpisodeFilter
    from vsnbench.results.reading.queries import list_episodes
    from vsnbench.results.schema.migrate import open_record
    from vsnbench.robots.registry import profile_of
    from vsnbench.runner.operator.provider import OperatorProvider
    from vsnbench.runner.setup import trying
    from vsnbench.runner.setup.launch import launch
    from vsnbench.runner.stopping.requests import Stopped

    spec, findings, decision_s = request.setup, list[ContractFinding](), 0.0
    with (
        without_prints_of_models(as_json=as_json),
        trying.opened_policy(spec.model, spec.options) as policy,
        ProgressBars() as progress,
    ):
        card = policy.card
        goals = spec.goals or (trying.first_goal(card, spec.site),)
        if not policy.needs_survey:
            decision_s = trying.decision_s(policy)
            for finding in check_policy(policy, profile_of(spec.robot), trying.steps_of_check(decision_s)):
                findings.append(finding)
                progress.show("check", len(findings), _CHECKS)
        whole = spec.parameters.max_actions
        if trying.max_actions(decision_s, whole) != whole:  # its first decisions may have compiled or loaded something
            decision_s = trying.decision_s(policy, probes=1)
    spec = replace(spec, goals=goals, parameters=spec.parameters.limited_to(trying.max_actions(decision_s, whole)))
    starts = request.starts or trying.first_starts(goals, spec.site)
    request = replace(request, setup=spec, starts=starts).at(request.site, spec.site)
    with without_prints_of_models(as_json=as_json):
        try:
            launched = launch(request, OperatorProvider(shows_episodes=False))
        except Stopped as stopped:
            typer.echo(f"stopped: {stopped.request.description}", err=True)
            return stopped.request.exit_code
    with open_record(request.results.database_url) as engine:
        wanted = EpisodeFilter(campaign=str(launched.campaign_id), goals=spec.goals)
        episodes = sorted(list_episodes(engine, wanted), key=lambda episode: episode.id)
        latest = {(episode.goal, episode.start): episode.id for episode in episodes if episode.start in starts}
        trials = [diagnose(engine, number) for number in latest.values()]
    failed = any(not finding.passed for finding in findings) or any(episode.outcome == "void" for episode, _ in trials)
    commands = _commands(request, root, again=failed)
    if as_json:
        rows = [as_fields(episode, found) for episode, found in trials]
        checks = [asdict(finding) for finding in findings]
        result = {"model": spec.model, "name": card.name, "checks": checks, "trials": rows}
        print_json({**result, "to_do": advice(trials, whole), **commands})
    else:
        title = f"{card.name} with {', '.join(sorted(card.sensors)) or 'no sensors'}"
        _print(title, findings, trials, whole, commands)
    return 1 if failed else 0


def _commands(request: "RunRequest", root: Path | None, *, again: bool) -> dict[str, str]:
    """Return the commands that open the film, and that run a campaign or, for a model with a fault, try it again."""
    directory = "" if root is None or root == Path.cwd() else f"cd {shlex.quote(str(root))} && "
    options = "".join(
        f" --{name.replace('_', '-')} {shlex.quote(str(value))}" for name, value in request.setup.model_options.items()
    )
    goal = shlex.quote(",".join(request.setup.goals))
    verb = "try" if again else "run --model"
    return {
        "film": f"vsnbench browse{request.results.options}",
        "next": f"{directory}vsnbench {verb} {shlex.quote(request.setup.model)}{options} --goal {goal}",
    }


def _print(
    title: str,
    findings: "Sequence[ContractFinding]",
    trials: "Sequence[tuple[EpisodeRecord, EpisodeDiagnosis]]",
    whole: int,
    commands: dict[str, str],
) -> None:
    from rich.markup import escape

    from vsnbench.cli.support.terminal import COLORS, page
    from vsnbench.report.diagnosis import advice, headline, story, timing

    console = page()

    def show(label: str, text: str, color: str = "") -> None:
        lines = textwrap.wrap(sanitize(text), _WIDTH - _LABEL, break_on_hyphens=False) or [""]
        for number, line in enumerate(lines):
            shown = f"[{color}]{escape(line)}[/]" if color else escape(line)
            console.print(f"{'' if number else label:<{_LABEL}}{shown}", soft_wrap=True)

    show("model", title)
    failed = [finding for finding in findings if not finding.passed]
    if not findings:
        show("check", "none: the model receives the site")
    else:
        show("check", f"{len(findings) - len(failed)} of {len(findings)} passed", "red" if failed else "green")
    reasons: dict[str, list[str]] = {}
    for finding in failed:
        reasons.setdefault(finding.seen, []).append(finding.what)
    for reason, checks in list(reasons.items())[:_MOST_REASONS]:
        show("", f"{checks[0]}{f' and {len(checks) - 1} more' if len(checks) > 1 else ''}: {reason}", "red")
    for number, (episode, found) in enumerate(trials, 1):
        show(f"trial {number}", headline(episode, found), COLORS[episode.outcome])
        if text := story(episode, found):
            show("", text)
    if text := timing(found for _, found in trials):
        limit = trials[0][0].provenance.protocol.get("max_actions", whole)
        show("time", text if limit == whole else f"{text}; trials were shortened from {whole} to {limit} actions")
    for line in advice(trials, whole):
        show("to do", line, "yellow")
    for label, line in commands.items():
        console.print(f"[dim]{label:<{_LABEL}}[/]{escape(sanitize(line))}", soft_wrap=True)
