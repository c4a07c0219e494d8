"""`vsnbench protocol`: list, show and check protocols."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.support.listing import print_list, prose_column
from vsnbench.cli.support.output import Json, fault_fields, fault_lines, print_json, print_result
from vsnbench.cli.support.terminal import safe
from vsnbench.report.table import Column

if TYPE_CHECKING:
    from vsnbench.protocol.parameters import ProtocolParameters

app = typer.Typer(
    no_args_is_help=True,
    help="""List, show and check protocols: the rules of the trials.

    vsnbench protocol list
    vsnbench protocol show habitat-objectnav
    vsnbench protocol check lab.yaml
    vsnbench run --model pirlnav --goal chair --protocol lab.yaml
    """,
)


@app.command("list")
def list_protocols(as_json: Json = False) -> None:
    """List the named protocols."""
    from vsnbench.protocol.named import NAMED

    if as_json:
        print_json([_content(named.parameters) | {"summary": named.summary} for named in NAMED.values()])
        return
    numbers = [Column(heading) for heading in ("actions", "time", "path", "success")]
    rows = []
    for name, each in NAMED.items():
        parameters = each.parameters
        limits = (_limit(parameters.max_time_s, "s"), _limit(parameters.max_path_m, "m"))
        success = f"under {parameters.success_distance_m:g} m"
        rows.append((name, str(parameters.max_actions), *limits, success, each.summary))
    print_list((Column("name", number=False), *numbers, prose_column("description")), rows)


@app.command()
def show(
    protocol: Annotated[str, typer.Argument(help="Name of a protocol, or path of a protocol file.")],
    as_json: Json = False,
) -> None:
    """Show every parameter of a protocol with its unit, default and source.

    vsnbench protocol show onsite-instruction
    """
    from vsnbench.protocol.named import NAMED, load_protocol, parameter_rows

    parameters = load_protocol(protocol)
    rows = parameter_rows(parameters, "" if protocol in NAMED else protocol)
    if as_json:
        print_json(_content(parameters) | {"parameters": [asdict(row) for row in rows]})
        return
    columns = (
        Column("parameter", number=False),
        Column("value"),
        Column("unit", number=False),
        Column("default", rank=2),
        prose_column("source", rank=1),
        prose_column("meaning", rank=3),
    )
    print_list(
        columns,
        [
            (row.name, safe(_text(row.value)), row.unit, _text(row.default), safe(row.source), safe(row.meaning))
            for row in rows
        ],
    )


@app.command()
def check(
    file: Annotated[str, typer.Argument(help="Path of a protocol file.", metavar="FILE")], as_json: Json = False
) -> None:
    """Check a protocol file and print all faults with their lines; exit code 1 if there are any.

    vsnbench protocol check lab.yaml
    """
    from vsnbench.protocol.named import protocol_file_faults

    faults = protocol_file_faults(file)
    fields = {"file": file, "faults": fault_fields(faults)}
    print_result(fields, "\n".join(fault_lines(file, faults)), as_json=as_json)
    if faults:
        raise typer.Exit(1)


def _content(parameters: "ProtocolParameters") -> dict[str, Any]:
    """Return the parameters as recorded, with the fields that a record of the default leaves out."""
    from vsnbench.results.writing.campaigns import content_sha256

    recorded = parameters.model_dump(mode="json")
    limits = {"max_time_s": parameters.max_time_s, "max_path_m": parameters.max_path_m}
    return {"name": parameters.name} | recorded | limits | {"sha256": content_sha256(recorded)}


def _limit(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:g} {unit}"


def _text(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)
