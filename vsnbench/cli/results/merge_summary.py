"""Summary of `vsnbench db merge`."""

from typing import Any

import typer

from vsnbench.cli.support.terminal import safe
from vsnbench.interop.merge import MergeResult
from vsnbench.results.files.directory import ResultsDirectory
from vsnbench.text.sanitize import counted


def merge_fields(merged: MergeResult, *, dry_run: bool) -> dict[str, Any]:
    """Return the summary of a merge as JSON fields."""
    plan = merged.plan
    return {
        "dry_run": dry_run,
        "others": [other.name for other in merged.others],
        "new_episodes": len(plan.new_episodes),
        "new_campaigns": len(plan.new_campaigns),
        "new_trials": sum(map(len, plan.new_trials.values())),
        "new_studies": plan.studies.new,
        "new_entries_of_studies": plan.studies.entries,
        "studies_no_longer_blind": [revealed.study["title"] for revealed in plan.studies.revealed],
        "known_episodes": plan.known,
        "episodes_with_new_verdicts_or_events": len(plan.updates),
        "second_results": plan.second_results,
        "not_ended": dict(zip((other.name for other in merged.others), plan.active, strict=True)),
        "without_images": merged.without_files,
        "files": merged.files.file_count,
        "file_bytes": merged.files.size_bytes,
        "repaired_episodes": len(merged.files.repairs),
        "damaged_here": merged.files.damaged_here,
    }


def print_merged(merged: MergeResult, target: ResultsDirectory, *, dry_run: bool) -> None:
    """Print the summary of a merge."""
    plan = merged.plan
    here = safe(str(target.path))
    if plan.changes:
        parts = [counted(len(plan.new_episodes), "new episode")]
        parts += [counted(len(plan.new_campaigns), "new campaign")] if plan.new_campaigns else []
        parts += [counted(plan.studies.new, "new study", "new studies")] if plan.studies.new else []
        count = merged.files.file_count
        parts += [f"{counted(count, 'file')} ({_size(merged.files.size_bytes)})"] if count else []
        verb = "would be merged" if dry_run else "merged"
        typer.echo(f"{verb} into {here}: {', '.join(parts)}")
    elif not merged.files.repairs:
        typer.echo(f"nothing to do: {here} already has everything")
    if merged.files.repairs:
        verb = "would be repaired" if dry_run else "repaired"
        typer.echo(f"{counted(len(merged.files.repairs), 'episode')} here: missing or damaged images {verb}")
    for line in merged.files.damaged_here:
        typer.echo(f"damaged here, and in all of these records: {safe(line)}", err=True)
    if plan.studies.entries:
        typer.echo(f"{counted(plan.studies.entries, 'further entry', 'further entries')} in the history of studies")
    for revealed in plan.studies.revealed:
        becomes = "would become" if dry_run else "is now"
        typer.echo(f"the study {revealed.title} {becomes} unblinded, as in one of the records")
    if plan.updates:
        typer.echo(f"{counted(len(plan.updates), 'episode')} here: verdicts or events added")
    if plan.known and plan.changes:
        typer.echo(f"{counted(plan.known, 'episode')} already known")
    if plan.second_results:
        typer.echo(
            f"{counted(plan.second_results, 'episode')}: second results of their trials; the lower number counts"
        )
    if merged.without_files:
        typer.echo(f"{counted(merged.without_files, 'episode')} merged without images")
    for other, active in zip(merged.others, plan.active, strict=True):
        if active:
            typer.echo(
                f"{safe(other.name)}: {counted(active, 'episode')} still running and left out; merge again when ended. "
                "The next `vsnbench run` there closes episodes of killed processes."
            )
    if plan.changes and not dry_run:
        typer.echo(f"next: vsnbench report{target.options}", err=True)


def _size(number: int) -> str:
    return f"{number / 1e9:.1f} GB" if number >= 1e9 else f"{number / 1e6:.1f} MB"
