"""Runs a stress test from the terminal, and prints, writes and draws its result."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from vsnbench.cli.running.summary import print_next
from vsnbench.cli.running.sweep_summary import print_sweep_summary, run_planned, sweep_console
from vsnbench.cli.support.output import print_json, without_prints_of_models
from vsnbench.cli.support.terminal import page
from vsnbench.errors import UsageError
from vsnbench.protocol.disturbances import NONE, Disturbances
from vsnbench.report.analysis.conditions import Selection
from vsnbench.report.analysis.summary import summarise
from vsnbench.report.build import read
from vsnbench.report.comparison.stress import StressedCampaigns, StressedModel, stressed_model
from vsnbench.report.measures import COUNT, Measure, Measures, objects
from vsnbench.report.table import print_tables
from vsnbench.report.tables.stress import STRESSED, stress_table
from vsnbench.runner.setup.request import RunRequest
from vsnbench.runner.setup.selection import possible_goals
from vsnbench.runner.setup.stress import condition_of
from vsnbench.runner.setup.sweep import Sweep, Swept, undone

_FORMATS = (".svg", ".pdf", ".png")
STRESS = Measures(
    Measure("trials_left", COUNT, "number of trials that the same command runs next time"),
    Measure("campaigns_failed", COUNT, "number of campaigns that could not run"),
    Measure("models", objects(STRESSED), "one object per model and site"),
)
"""The JSON object of a stress test."""


def check_figure(path: Path | None) -> None:
    """Check the file of `--figure` before trials are run.

    Raises:
        UsageError: no figure can be written there.
    """
    if path is None:
        return
    if path.suffix not in _FORMATS:
        raise UsageError(f"--figure {path}: unknown format", advice="name a .svg, .pdf or .png file", code="bad-figure")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"--figure {path}: the directory does not exist", advice="create it first", code="bad-figure")


def run_stress(
    sweep: Sweep, request: RunRequest, unseen: Mapping[str, Sequence[str]], figure: Path | None, *, as_json: bool
) -> int:
    """Run a stress test and return the exit code: 0 if every trial is done, 1 if some are left.

    Args:
        sweep: every campaign under every condition.
        request: options that they share.
        unseen: disturbances that are left out, by model.
        figure: file of the figure.
        as_json: print the result as JSON.

    Raises:
        Stopped: a person or the system asked to stop.
    """
    with without_prints_of_models(as_json=as_json):
        swept = run_planned(sweep, request)
    print_sweep_summary(sweep_console(), swept, request.results)
    models = _stressed(swept, unseen, request)
    if figure is not None and any(model.losses for model in models):
        from vsnbench.files.atomic import write_atomic
        from vsnbench.report.figures.severity import success_by_severity

        drawing = success_by_severity(models)
        write_atomic(figure, {".svg": drawing.svg, ".pdf": drawing.pdf, ".png": drawing.png}[figure.suffix]())
    left, failed = undone(swept)
    if as_json:
        print_json(STRESS.fields({"trials_left": left, "campaigns_failed": failed, "models": models}))
    else:
        print_tables([stress_table(model) for model in models], page())
        if examples := [trial for model in models for harm in model.most_harmful for trial in harm.examples]:
            print_next(sweep_console(), f"view {examples[0].disturbed}{request.results.options}")
    return 1 if left or failed else 0


def _stressed(swept: Sequence[Swept], unseen: Mapping[str, Sequence[str]], request: RunRequest) -> list[StressedModel]:
    """Return the losses of every model in every site for the requested goals; none where nothing has a result."""
    results, parameters = request.results, request.setup.parameters
    found: dict[tuple[str, str], dict[Disturbances, list[int]]] = {}
    for campaign in swept:
        if campaign.session is not None:
            own = found.setdefault((campaign.request.setup.model, campaign.request.site), {})
            condition = condition_of(campaign.request.setup, parameters)
            own.setdefault(condition, []).append(campaign.session.campaign_id)
    numbers = [number for own in found.values() for several in own.values() for number in several]
    if not numbers:
        return []
    setups = [campaign.request.setup for campaign in swept if campaign.session is not None]
    goals = dict.fromkeys(goal for setup in setups for goal in possible_goals(setup.goals, setup.site))
    record = read(results.database_url, Selection(campaigns=numbers, goals=tuple(goals)), results.path)
    summaries = summarise(record)
    models = []
    for (name, _), own in found.items():
        disturbed = {chosen.members[0]: tuple(several) for chosen, several in own.items() if chosen}
        campaigns = StressedCampaigns(tuple(own.get(NONE, ())), disturbed, tuple(unseen.get(name, ())))
        if model := stressed_model(record, summaries, campaigns):
            models.append(model)
    return models
