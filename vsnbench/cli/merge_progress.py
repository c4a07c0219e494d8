"""What a person sees of a merge: a bar while it goes on, and afterwards what came in, what stayed away and why."""

import sys
from types import TracebackType
from typing import Any, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeRemainingColumn

from vsnbench.cli.episode_page import safe
from vsnbench.exchange.merge import Merged
from vsnbench.record.results import ResultsDirectory


class MergeProgress:
    """A bar on stderr where that is a terminal; a context manager."""

    def __init__(self) -> None:
        console = Console(file=sys.stderr, highlight=False)
        columns = (TextColumn("{task.description}"), BarColumn(24), TaskProgressColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def told(self, what: str, done: int, of: int) -> None:
        """Show how much of what is done."""
        if what not in self._tasks:
            self._tasks[what] = self._bar.add_task(what)
        self._bar.update(self._tasks[what], completed=done, total=of)


def merge_fields(merged: Merged, *, dry_run: bool) -> dict[str, Any]:
    """Return what a merge did as JSON has it."""
    plan = merged.plan
    return {
        "dry_run": dry_run,
        "others": [other.name for other in merged.others],
        "new_episodes": len(plan.arrivals),
        "new_campaigns": plan.campaigns,
        "new_trials": plan.trials,
        "new_studies": plan.studies.new,
        "new_entries_of_studies": plan.studies.entries,
        "studies_no_longer_blind": [one.study["title"] for one in plan.studies.revealed],
        "known_episodes": plan.known,
        "episodes_with_new_verdicts_or_events": len(plan.additions),
        "second_results": plan.second_results,
        "not_ended": dict(zip((other.name for other in merged.others), plan.active, strict=True)),
        "without_images": merged.without_files,
        "files": merged.files,
        "file_bytes": merged.file_bytes,
    }


def tell_merged(merged: Merged, target: ResultsDirectory, *, dry_run: bool) -> None:
    """Print it in words."""
    plan = merged.plan
    here = safe(str(target.path))
    if plan.changes:
        campaigns = f", {_count(plan.campaigns, 'new campaign')}" if plan.campaigns else ""
        campaigns += f", {_count(plan.studies.new, 'new study', 'new studies')}" if plan.studies.new else ""
        size = f"; {_count(merged.files, 'file')}, {_size(merged.file_bytes)}" if merged.files else ""
        verb = "would come" if dry_run else "came"
        typer.echo(f"{_count(len(plan.arrivals), 'new episode')} {verb} into {here}{campaigns}{size}")
    else:
        typer.echo(f"nothing to do: everything is in {here} already")
    if plan.studies.entries:
        typer.echo(f"{_count(plan.studies.entries, 'further entry', 'further entries')} in the history of studies")
    for one in plan.studies.revealed:
        becomes = "would be" if dry_run else "is"
        typer.echo(f"the study {one.title} {becomes} blind no more: it was unblinded in one of the records")
    if plan.additions:
        typer.echo(f"{_count(len(plan.additions), 'episode')} here: further verdicts or events added")
    if plan.known and plan.changes:
        typer.echo(f"{_count(plan.known, 'episode')} already known")
    if plan.second_results:
        are = "is the second result of a trial" if plan.second_results == 1 else "are second results of their trials"
        typer.echo(f"{_count(plan.second_results, 'episode')} {are}: the lower number counts")
    if merged.without_files:
        typer.echo(f"{_count(merged.without_files, 'episode')} without the images that they had")
    for other, active in zip(merged.others, plan.active, strict=True):
        if active:
            typer.echo(
                f"{safe(other.name)}: {_count(active, 'episode')} still running, left out. Merge again when ended; "
                "what a dead process left, the next `vsnbench run` there closes"
            )
    if plan.changes and not dry_run:
        typer.echo(f"next: vsnbench report{target.options}", err=True)


def _count(number: int, what: str, many: str = "") -> str:
    return f"{number} {what if number == 1 else many or what + 's'}"


def _size(number: int) -> str:
    return f"{number / 1e9:.1f} GB" if number >= 1e9 else f"{number / 1e6:.1f} MB"
