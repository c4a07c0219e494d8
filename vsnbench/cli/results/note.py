"""`vsnbench note`: add notes and tags to episodes at any time."""

from typing import Annotated

import typer

from vsnbench.cli.support.lists import split_list
from vsnbench.cli.support.options import Database, Results, open_results
from vsnbench.cli.support.output import Json, print_result
from vsnbench.errors import UsageError
from vsnbench.text.number_ranges import read_numbers


def command(
    episodes: Annotated[str, typer.Argument(metavar="N,N-M", help="Numbers of the episodes.")],
    note: Annotated[str, typer.Argument(metavar="NOTE", help="Text of the note.")] = "",
    tag: Annotated[list[str] | None, typer.Option("--tag", metavar="A,B", help="Add these tags.")] = None,
    untag: Annotated[list[str] | None, typer.Option("--untag", metavar="A,B", help="Remove these tags.")] = None,
    as_json: Json = False,
    results: Results = None,
    db: Database = None,
) -> None:
    """Add a note or tags to episodes. Earlier notes stay in the record, and no verdict changes.

    The author is $VSNBENCH_OPERATOR, else the login name. `vsnbench episodes show N` prints the notes.

    [bold]Examples[/bold]

        vsnbench note 17 "a door was half closed"
        vsnbench note 12,15-18 --tag chair-moved
        vsnbench note 17 --untag chair-moved
        vsnbench episodes list --tag chair-moved
    """
    from vsnbench.results.annotations import read_annotation, tags_of
    from vsnbench.results.schema.engine import reading, transaction
    from vsnbench.results.writing.journal import Journal
    from vsnbench.results.writing.provenance import gather_provenance

    numbers = read_numbers(episodes, "episode", "12,15-18")
    annotation = read_annotation(note, split_list(tag), split_list(untag))
    if not (annotation.note or annotation.tags or annotation.removed_tags):
        raise UsageError(
            "nothing to add", advice="give a text, --tag or --untag, like `vsnbench note 17 --tag chair-moved`"
        )
    # Refuses a missing record, which the journal would create, and one that it would upgrade.
    with open_results(results, db, reads_copy=False) as (place, _):
        provenance = gather_provenance()
    with Journal.open(place.database_url, provenance) as journal:
        journal.annotate(numbers, annotation, author=provenance.operator)
        with transaction(reading(journal.engine)) as connection:
            tags = tags_of(connection, numbers)
    fields = [{"id": number, "tags": tags.get(number, ()), "author": provenance.operator} for number in numbers]
    noted = "noted; " if annotation.note else ""
    shown = {number: f"tags {', '.join(tags[number])}" if number in tags else "no tags" for number in numbers}
    text = "\n".join(f"episode {number}: {noted}{its_tags}" for number, its_tags in shown.items())
    print_result(fields, text, as_json=as_json)
