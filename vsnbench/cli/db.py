"""`vsnbench db`: where the results database is, its state, upgrade and backup; and several records into one."""

from pathlib import Path
from typing import Annotated

import typer

from vsnbench.cli.options import Database, Results
from vsnbench.cli.output import Json, print_files, print_json

app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich")


@app.command()
def path(results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Print where the database is (for SQLite its file, else its URL without the password).

    Example: [bold]sqlite3 "$(vsnbench db path)"[/bold]
    """
    from vsnbench.database_url import sqlite_path
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    file = sqlite_path(place.database_url)
    where = str(file.resolve()) if file else place.shown_database
    if as_json:
        print_json({"database": where})
    else:
        typer.echo(where)


@app.command()
def status(results: Results = None, db: Database = None, as_json: Json = False) -> None:
    """Say what is in the database: schema, campaigns with their progress, episodes, size.

    Example: [bold]vsnbench db status --results /data/apartment[/bold]
    """
    from dataclasses import asdict

    from vsnbench.cli.episode_page import safe
    from vsnbench.cli.listing import ListColumn, print_list
    from vsnbench.database.engine import open_engine
    from vsnbench.database.migrate import schema_state
    from vsnbench.database.queries import campaign_states, count_episodes
    from vsnbench.database.read_shapes import EpisodeFilter
    from vsnbench.database_url import sqlite_path
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    engine = open_engine(place.database_url, read_only=True)
    schema = schema_state(engine)
    file = sqlite_path(place.database_url)
    size = file.stat().st_size if file else None
    campaigns = campaign_states(engine) if schema.up_to_date else ()
    outcomes = ("success", "failure", "unjudged", "void", "running")
    episodes = {
        outcome: count_episodes(engine, EpisodeFilter(outcome=outcome)) for outcome in outcomes if schema.up_to_date
    }
    engine.dispose()
    if as_json:
        print_json(
            {
                "database": place.shown_database,
                "schema": schema.current,
                "newest_schema": schema.head,
                "size_bytes": size,
                "episodes": episodes,
                "campaigns": [asdict(campaign) for campaign in campaigns],
            }
        )
        return
    typer.echo(f"database  {place.shown_database}" + (f"  ({size / 1e6:.1f} MB)" if size else ""))
    if not schema.up_to_date:
        have = f"schema {schema.current}" if schema.current else "empty"
        typer.echo(f"schema    {have}, this version works with {schema.head}: `vsnbench db upgrade` brings it there")
        return
    typer.echo(f"schema    {schema.current}, up to date")
    told = ", ".join(f"{number} {outcome}" for outcome, number in episodes.items() if number)
    typer.echo(f"episodes  {sum(episodes.values())}" + (f" ({told})" if told else ""))
    if not campaigns:
        return
    columns = (
        ListColumn("campaign", right=True),
        ListColumn("name", least=44, wraps=True),
        ListColumn("seed", right=True, rank=0 if len({campaign.seed for campaign in campaigns}) > 1 else 3),
        ListColumn("robot", rank=2),
        ListColumn("trials done", right=True),
        ListColumn("begun (UTC)", rank=1),
    )
    rows = [
        (
            str(campaign.id),
            safe(campaign.name),
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
    """Bring the database to this version's schema, all of it or nothing; `vsnbench run` does it by itself.

    Example: [bold]vsnbench db backup before.db && vsnbench db upgrade[/bold]
    """
    from vsnbench.database.engine import open_engine
    from vsnbench.database.migrate import upgrade as migrate
    from vsnbench.database_url import sqlite_path
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    if sqlite_path(place.database_url):
        place.prepare()
    engine = open_engine(place.database_url)
    before = migrate(engine)
    engine.dispose()
    if as_json:
        print_json({"database": place.shown_database, "schema_before": before.current, "schema": before.head})
    elif before.up_to_date:
        typer.echo(f"{place.shown_database} is up to date (schema {before.head})")
    else:
        typer.echo(f"{place.shown_database}: schema {before.current or 'none'} -> {before.head}")


@app.command()
def backup(
    target: Annotated[Path, typer.Argument(help="The file to write; it must not exist.")],
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Copy the database to a file, also while a run is writing it; the file appears whole or not at all.

    SQLite becomes one SQLite file, PostgreSQL an archive for pg_restore. The images are not part of it.

    Example: [bold]vsnbench db backup "results-$(date +%F).db"[/bold]
    """
    from vsnbench.database.migrate import backup as copy
    from vsnbench.record.results import ResultsDirectory

    place = ResultsDirectory.locate(results, db)
    copy(place.database_url, target)
    size = target.stat().st_size
    if as_json:
        print_files([target], as_json=True, size_bytes=size)
    else:
        typer.echo(f"{target}  ({size / 1e6:.1f} MB)")


@app.command()
def merge(
    others: Annotated[
        list[str], typer.Argument(metavar="OTHER...", help="Results directories, or database URLs.", show_default=False)
    ],
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would come in; write nothing.")] = False,
    without_images: Annotated[
        bool, typer.Option("--without-images", help="Take in episodes whose images are not there.")
    ] = False,
    results: Results = None,
    db: Database = None,
    as_json: Json = False,
) -> None:
    """Bring the campaigns and episodes of other records into this one, with their images; the others stay as they are.

    The same condition and seed is one campaign. Episodes keep their UUID and get new numbers; what is here already is
    passed over, verdicts that one side lacks are added, and a contradiction stops it before anything is written.
    A study is one where the same was locked: its schedule stays one, and all that was done to it anywhere is kept.

    Example: [bold]vsnbench db merge /mnt/lab-b/results monday tuesday --results all[/bold]
    """
    from vsnbench.cli.merge_progress import MergeProgress, merge_fields, tell_merged
    from vsnbench.cli.study_file import forget_blind_copies
    from vsnbench.exchange.merge import merge as merge_records
    from vsnbench.exchange.merge import other_place
    from vsnbench.record.results import ResultsDirectory

    target = ResultsDirectory.locate(results, db)
    with MergeProgress() as progress:
        merged = merge_records(
            target,
            [other_place(other) for other in others],
            without_images=without_images,
            dry_run=dry_run,
            told=progress.told,
        )
    if not dry_run:
        for one in merged.plan.studies.revealed:
            forget_blind_copies(target, one.study["uuid"])
    if as_json:
        print_json(merge_fields(merged, dry_run=dry_run))
    else:
        tell_merged(merged, target, dry_run=dry_run)
