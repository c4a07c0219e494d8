"""`vsnbench db`: location, state, upgrade, backup and merge of the results database."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vsnbench.cli.support.listing import print_list
from vsnbench.cli.support.lists import split_numbers
from vsnbench.cli.support.options import Database, Results, open_results, results_directory
from vsnbench.cli.support.output import Json, confirm, print_json, print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.errors import UsageError
from vsnbench.report.table import Column
from vsnbench.text.sanitize import counted

if TYPE_CHECKING:
    from vsnbench.results.writing.deletion import Deletion

app = typer.Typer(no_args_is_help=True)

_LONG_SEED = 10**8
"""Imports have seeds of up to 19 digits."""


@app.command()
def path(results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Print the location of the database: the SQLite file, or the URL without its password.

    Example: [bold]sqlite3 "$(vsnbench db path)"[/bold]
    """
    from vsnbench.results.database_url import sqlite_path

    place = results_directory(results, db)
    file = sqlite_path(place.database_url)
    where = str(file.resolve()) if file else place.database_label
    print_result({"database": where}, where, as_json=as_json)


@app.command()
def status(results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Show the schema, campaigns with their progress, number of episodes and size.

    Example: [bold]vsnbench db status --results /data/apartment[/bold]
    """
    from vsnbench.results.database_url import sqlite_path
    from vsnbench.results.model import CAMPAIGN
    from vsnbench.results.reading.queries import list_campaigns, outcome_counts
    from vsnbench.results.schema.engine import open_engine
    from vsnbench.results.schema.migrate import schema_state

    place = results_directory(results, db)
    engine = open_engine(place.database_url, read_only=True)
    schema = schema_state(engine)
    file = sqlite_path(place.database_url)
    size = file.stat().st_size if file else None
    campaigns = list_campaigns(engine) if schema.up_to_date else ()
    episodes = outcome_counts(engine) if schema.up_to_date else {}
    engine.dispose()
    if as_json:
        print_json(
            {
                "database": place.database_label,
                "schema": schema.current,
                "newest_schema": schema.head,
                "size_bytes": size,
                "episodes": episodes,
                "campaigns": [CAMPAIGN.json(campaign) for campaign in campaigns],
            }
        )
        return
    typer.echo(f"database  {place.database_label}" + (f"  ({size / 1e6:.1f} MB)" if size else ""))
    if not schema.up_to_date:
        current = schema.current or "none"
        typer.echo(f"schema    {current}, and this version needs {schema.head}: run `vsnbench db upgrade`")
        return
    typer.echo(f"schema    {schema.current}, up to date")
    counts = ", ".join(f"{number} {outcome}" for outcome, number in episodes.items() if number)
    typer.echo(f"episodes  {sum(episodes.values())}" + (f" ({counts})" if counts else ""))
    if not campaigns:
        return
    seeds = {campaign.seed for campaign in campaigns}
    columns = (
        Column("campaign"),
        Column("name", number=False, min_width=44 if max(seeds) < _LONG_SEED else 32, wraps=True),
        Column("seed", rank=0 if len(seeds) > 1 else 3),
        Column("robot", number=False, rank=2),
        Column("trials done"),
        Column("begun (UTC)", number=False, rank=1),
    )
    rows = [
        (
            str(campaign.id),
            safe(campaign.title),
            str(campaign.seed),
            "simulated" if campaign.simulated else "real",
            f"{campaign.done} of {campaign.trials}",
            f"{campaign.created_at:%Y-%m-%d}",
        )
        for campaign in campaigns
    ]
    typer.echo()
    print_list(columns, rows)


@app.command()
def upgrade(results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Upgrade the database to the schema of this version, in one transaction. `vsnbench run` does it as well.

    Example: [bold]vsnbench db backup before.db && vsnbench db upgrade[/bold]
    """
    from vsnbench.results.database_url import sqlite_path
    from vsnbench.results.schema.engine import open_engine
    from vsnbench.results.schema.migrate import upgrade as migrate

    place = results_directory(results, db)
    if sqlite_path(place.database_url):
        place.prepare()
    engine = open_engine(place.database_url)
    before = migrate(engine)
    engine.dispose()
    fields = {"database": place.database_label, "schema_before": before.current, "schema": before.head}
    change = f": schema {before.current or 'none'} -> {before.head}"
    text = f" is up to date (schema {before.head})" if before.up_to_date else change
    print_result(fields, place.database_label + text, as_json=as_json)


@app.command()
def backup(
    target: Annotated[Path, typer.Argument(help="Path of a new file.")],
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Copy the database to a file, also during a run. The file appears when it is complete.

    SQLite becomes one SQLite file, PostgreSQL an archive for pg_restore. Images are not part of it.

    Example: [bold]vsnbench db backup "results-$(date +%F).db"[/bold]
    """
    from vsnbench.results.schema.backup import backup as copy

    place = results_directory(results, db)
    copy(place.database_url, target)
    size = target.stat().st_size
    fields = {"files": [str(target)], "size_bytes": size}
    print_result(fields, f"{target}  ({size / 1e6:.1f} MB)", as_json=as_json)


@app.command()
def restore(
    source: Annotated[Path, typer.Argument(help="File from `vsnbench db backup`.")],
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Replace the database with a backup; the current one is kept next to it. Images are not changed.

    Example: [bold]vsnbench db restore results-2026-11-20.db[/bold]
    """
    from vsnbench.results.writing.restore import restore as replace

    place = results_directory(results, db)
    place.prepare()
    kept = replace(place.database_url, source, place.path)
    fields = {"database": place.database_label, "restored": str(source), "kept": str(kept) if kept else None}
    previous = f"\nprevious database: {kept}" if kept else ""
    print_result(fields, f"restored {place.database_label} from {source}{previous}", as_json=as_json)


@app.command()
def merge(
    others: Annotated[
        list[str], typer.Argument(metavar="OTHER...", help="Results directories or database URLs.", show_default=False)
    ],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be merged; write nothing.")] = False,
    without_images: Annotated[
        bool, typer.Option("--without-images", help="Merge episodes whose images are missing or damaged without them.")
    ] = False,
    images: Annotated[
        list[Path] | None,
        typer.Option(
            "--images",
            metavar="DIR",
            help="Results directory with images of episodes in a PostgreSQL database (repeatable).",
        ),
    ] = None,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Merge campaigns, episodes and images of other records into this one; the others are not changed.

    Campaigns with the same condition and seed become one. Episodes keep their UUID and get new numbers; episodes that
    are already here are skipped, missing verdicts are added, and a contradiction stops the merge before any change.
    Images are checked against the database; damaged images here are repaired from an intact copy.
    Copies of a locked study become one, with all entries of its log.

    Robots that write into one PostgreSQL database have one image directory each: give them with `--images`.

    Example: [bold]vsnbench db merge /mnt/lab-b/results monday tuesday --results all[/bold]
    """
    from vsnbench.cli.results.merge_summary import merge_fields, print_merged
    from vsnbench.cli.study.file import remove_blind_copies
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.interop.merge import merge as merge_records
    from vsnbench.interop.merge import merge_source

    target = results_directory(results, db)
    with ProgressBars() as progress:
        merged = merge_records(
            target,
            [merge_source(other, images or ()) for other in others],
            without_images=without_images,
            dry_run=dry_run,
            progress=progress.show,
        )
    if not dry_run:
        for revealed in merged.plan.studies.revealed:
            remove_blind_copies(target, revealed.study["uuid"])
    if as_json:
        print_json(merge_fields(merged, dry_run=dry_run))
    else:
        print_merged(merged, target, dry_run=dry_run)


@app.command("remove-import")
def remove_import(
    campaign: Annotated[int, typer.Argument(help="Number of the import's campaign, as in `vsnbench db status`.")],
    note: Annotated[str, typer.Option("--note", help="Reason for the removal.")] = "",
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Make all episodes of an import void, so that a corrected file can be imported.

    Example: [bold]vsnbench db remove-import 4 --note "results of the wrong checkpoint"[/bold]
    """
    from vsnbench.results.writing.journal import Journal
    from vsnbench.results.writing.provenance import gather_provenance

    provenance = gather_provenance()
    with Journal.open(results_directory(results, db).database_url, provenance) as journal:
        number = journal.withdraw_import(campaign, author=provenance.operator, note=note)
    text = f"{number} episodes of campaign {campaign} are void; `vsnbench judge` can restore single ones"
    print_result({"campaign": campaign, "void_episodes": number}, text, as_json=as_json)


@app.command("delete")
def delete_(
    episode: Annotated[
        list[str] | None, typer.Option("--episode", metavar="N,N-M", help="Delete these episodes.")
    ] = None,
    campaign: Annotated[
        list[str] | None, typer.Option("--campaign", metavar="N,N-M", help="Delete these campaigns with all episodes.")
    ] = None,
    reason: Annotated[str, typer.Option("--reason", help="Why; it is recorded with your name.")] = "",
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask; needed in scripts.")] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Delete episodes or campaigns for good. `vsnbench judge N --void WHY` keeps them and is usually better.

    A backup of the database and the episodes' images go to `deleted/` in the results directory; remove that directory
    to free the space. Data of a locked study cannot be deleted. If it is interrupted, repeat it; the next run
    finishes it as well.
    The trials of deleted episodes run again with the next `vsnbench run`.

    Example: [bold]vsnbench db delete --episode 3,7-9 --reason "a visitor is recognisable"[/bold]
    """
    from vsnbench.results.schema.engine import reading, transaction
    from vsnbench.results.writing.deletion import delete_for_good, finish_deletions, plan_deletion
    from vsnbench.results.writing.provenance import gather_provenance

    episodes = split_numbers(episode, "--episode", "3,7-9")
    campaigns = split_numbers(campaign, "--campaign", "2,4")
    if not episodes and not campaigns:
        raise UsageError("nothing to delete", advice="give --episode or --campaign", code="no-episode")
    if not reason.strip():
        raise UsageError("no reason given", advice='add --reason "..."; it stays in the record', code="no-reason")
    for plan, aside in finish_deletions(results_directory(results, db), required=True):
        episodes = tuple(number for number in episodes if number not in plan.episodes)
        campaigns = tuple(number for number in campaigns if number not in plan.campaigns)
        if not episodes and not campaigns:
            _print_deletion(plan, aside, as_json=as_json)
            return
    with (
        open_results(results, db, reads_copy=False) as (place, engine),
        transaction(reading(engine)) as connection,
    ):
        plan = plan_deletion(connection, episodes, campaigns)
    what = _content(plan)
    if not yes:
        confirm(f"{what} would be deleted", f"Delete {what} for good?", "nothing was deleted")
    plan, aside = delete_for_good(place, episodes, campaigns, author=gather_provenance().operator, reason=reason)
    _print_deletion(plan, aside, as_json=as_json)


def _content(plan: "Deletion") -> str:
    what = counted(len(plan.episodes), "episode")
    return f"{what} and {counted(len(plan.campaigns), 'campaign')}" if plan.campaigns else what


def _print_deletion(plan: "Deletion", aside: Path, *, as_json: bool) -> None:
    fields = {"episodes": plan.episodes, "campaigns": plan.campaigns, "backup": str(aside)}
    print_result(fields, f"deleted {_content(plan)}; backup and images: {aside}", as_json=as_json)
