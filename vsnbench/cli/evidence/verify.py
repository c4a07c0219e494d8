"""`vsnbench verify`: checks that results are as they were recorded and that their verdicts follow from them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vsnbench.cli.support.listing import print_list
from vsnbench.cli.support.output import Json, print_json
from vsnbench.cli.support.terminal import page, safe
from vsnbench.errors import UsageError
from vsnbench.report.table import Column
from vsnbench.text.sanitize import counted

if TYPE_CHECKING:
    from vsnbench.evidence.verification.checks import Verification

_SHOWN = 50
"""Number of findings printed; JSON has all."""


def command(
    path: Annotated[
        Path, typer.Argument(metavar="FILE|DIR", help="Bundle from `vsnbench bundle`, or results directory.")
    ],
    replay: Annotated[
        str, typer.Option("--replay", metavar="N|all", help="Drive simulated episodes again and compare every pose.")
    ] = "0",
    signers: Annotated[
        Path | None,
        typer.Option("--signers", metavar="FILE", help="File of trusted signers, in the format of ssh-keygen."),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="FILE|DIR", help="Record of the same trials to compare with, step by step."),
    ] = None,
    page: Annotated[
        Path | None, typer.Option("--page", metavar="FILE", help="HTML page to write, with what was checked.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Verify results that you or others recorded. Needs no network, and writes nothing there.

    Checks every hash and value, every image against its row, every episode against the rules of its protocol, the
    report, and the lock, schedule, log and end of every study. Verdicts of people are counted by author: they cannot
    be computed again.

    [bold]Examples[/bold]

        vsnbench verify study.zip
        vsnbench verify results --replay 20
        vsnbench verify study.zip --replay all --page verified.html
        vsnbench verify results --against results-of-another-machine
    """
    from vsnbench.cli.support.progress import ProgressBars
    from vsnbench.evidence.verification.verify import VerifyOptions, verify

    options = VerifyOptions(_replays(replay), signers, against)
    with ProgressBars() as progress:
        found = verify(path, progress.show, options)
    if page is not None:
        from vsnbench.evidence.verification.page import write_page

        write_page(found, page)
    if as_json:
        print_json(_fields(found))
    else:
        _print(found)
    raise typer.Exit(0 if found.holds else 1)


def _replays(text: str) -> int | None:
    if text == "all":
        return None
    if not (text.isdecimal() and len(text) < 10):
        raise UsageError(f"--replay {text} is not a number", advice="give a number of episodes, or `all`")
    return int(text)


def _fields(found: "Verification") -> dict[str, Any]:
    return {
        "subject": found.subject,
        "holds": found.holds,
        "version": found.version,
        "written_by": found.written_by,
        "checks": [
            {
                "check": check.name,
                "unit": check.unit,
                "checked": check.checked,
                "failed": check.failed,
                "not_checked": dict(check.not_checked),
                "notes": check.notes,
                "findings": [{"where": finding.where, "text": finding.text} for finding in check.findings],
            }
            for check in found.checks
        ],
        "verdicts_of_people": found.people,
    }


def _print(found: "Verification") -> None:
    columns = (
        Column("check", number=False),
        Column("items", number=False),
        *(Column(heading) for heading in ("checked", "failed", "not checked")),
    )
    print_list(
        columns,
        [
            (
                check.name,
                check.unit,
                f"{check.checked:,}",
                f"[red]{check.failed:,}[/red]" if check.failed else "0",
                f"{sum(check.not_checked.values()):,}",
            )
            for check in found.checks
        ],
    )
    console = page()
    console.print()
    for check in found.checks:
        for note in check.notes:
            console.print(safe(note), soft_wrap=True)
        for reason, count in sorted(check.not_checked.items()):
            console.print(f"[dim]{check.name}: {count:,} not checked: {safe(reason)}[/dim]", soft_wrap=True)
    for author, count in sorted(found.people.items()):
        console.print(f"judged by a person: {counted(count, 'verdict')} of {safe(author)}", soft_wrap=True)
    findings = [finding for check in found.checks for finding in check.findings]
    for finding in findings[:_SHOWN]:
        console.print(f"[red]{safe(finding)}[/red]", soft_wrap=True)
    if len(findings) > _SHOWN:
        console.print(f"and {len(findings) - _SHOWN:,} more: see --json")
    written = ", ".join(map(safe, found.written_by)) or "unknown"
    verdict = "[green]everything that could be checked holds[/green]" if found.holds else "[red]does not hold[/red]"
    console.print(f"{safe(found.subject)}: {verdict}", soft_wrap=True)
    console.print(f"[dim]verified by vsnbench {found.version}; recorded by vsnbench {written}[/dim]", soft_wrap=True)
