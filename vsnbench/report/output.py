"""Writes a report into a directory (page, tables in every format, figures) and serves the page."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from vsnbench.errors import UsageError
from vsnbench.report.measures import TEXTS, Measure, Measures

if TYPE_CHECKING:  # a report on the terminal needs neither the formats nor the figures
    from vsnbench.report.build import Report
    from vsnbench.report.figures.style import Drawing
    from vsnbench.report.table import ReportTable

FILES = Measures(
    Measure("files", TEXTS, "paths of the written files"),
)
"""The JSON object of the commands that write a report into a directory."""
Named = TypeVar("Named", "ReportTable", "Drawing")


def write_report(
    report: "Report",
    drawings: "Sequence[Drawing]",
    directory: Path,
    only_tables: Sequence[str] = (),
    column_in: float | None = None,
) -> tuple[Path, ...]:
    """Write all files of a report and return their paths.

    `report.html` (self-contained), `report.md`, `report.csv`, `report.json`, `tables.tex` and a file of `tables/`
    for each table to paste into a paper, `report.tex` to compile, `figures/` with SVG, PDF and PNG of each figure, and
    `pictures/` with the images of the failures in the table `narrative`.

    Args:
        report: the report.
        drawings: its figures.
        directory: where to write.
        only_tables: names of tables; without any, all tables.
        column_in: width of a paper's column for the LaTeX tables, inches; None for the default.

    Raises:
        UsageError: a table does not exist.
        RecordError: the directory cannot be written.
    """
    from vsnbench.files.atomic import write_atomic
    from vsnbench.report.formats.csv import to_csv
    from vsnbench.report.formats.html import html_page
    from vsnbench.report.formats.json import to_json
    from vsnbench.report.formats.latex import document, label, latex
    from vsnbench.report.formats.markdown import markdown

    tables = named(report.tables(long=True), only_tables, "--table")
    figures = [
        (f"figures/{drawing.name}.pdf", drawing.is_wide, f"{drawing.title}. {drawing.caption}") for drawing in drawings
    ]
    files: dict[str, bytes] = {
        "report.html": html_page(report, tables, drawings).encode(),
        "report.md": markdown(tables).encode(),
        "report.csv": to_csv(report.results).encode(),
        "report.json": to_json(
            report.results, report.questions, report.activity, report.record, report.operator_activity, report.raters
        ).encode(),
        "tables.tex": latex(tables, column_in).encode(),
        "report.tex": document(tables, figures, column_in).encode(),
    }
    for table in tables:
        files[f"tables/{label(table.name)}.tex"] = latex([table], column_in).encode()
    for drawing in drawings:
        files[f"figures/{drawing.name}.svg"] = drawing.svg()
        files[f"figures/{drawing.name}.pdf"] = drawing.pdf()
        files[f"figures/{drawing.name}.png"] = drawing.png()
    files |= _pictures(report)
    for name, content in files.items():
        write_atomic(directory / name, content)
    return tuple(directory / name for name in files)


def _pictures(report: "Report") -> dict[str, bytes]:
    """Return the images of the failures that the table `narrative` names, by file."""
    from vsnbench.report.figures.frame_strips import frame_strip
    from vsnbench.report.tables.failures import picture_file

    record, failures = report.record, report.activity.failures if report.activity else ()
    examples = {example["episode"] for found in failures for example in found["examples"] if example["pictured"]}
    if record.results_directory is None or not examples:
        return {}
    rows = record.episodes[record.episodes["episode"].isin(examples)]
    strips = {
        picture_file(int(episode)): frame_strip(record.results_directory, str(images))
        for episode, images in zip(rows["episode"], rows["images_directory"], strict=True)
    }
    return {name: strip.jpeg for name, strip in strips.items() if strip is not None}


def named(items: Sequence[Named], names: Sequence[str], option: str) -> list[Named]:
    """Return the tables or figures with these names in this order; all of them without names.

    Raises:
        UsageError: one does not exist.
    """
    known = {item.name: item for item in items}
    for name in names:
        if name not in known:
            raise UsageError(
                f"{option} {name}: this report has no such part",
                advice=f"it has {', '.join(known)}",
                code="unknown-part",
            )
    return [known[name] for name in names] or list(items)


def serve_page(page: str, port: int, announce: Callable[[str], None]) -> None:
    """Serve the page on 127.0.0.1 until interrupted.

    Args:
        page: the HTML.
        port: 0 for any free port.
        announce: called with the address once the server answers.

    Raises:
        UsageError: `port-unavailable`, the port is in use.
    """
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import HTMLResponse
    from starlette.routing import Route

    from vsnbench.web_server.server import WebServer
    from vsnbench.web_server.session_key import SessionKey

    def report(_request: Request) -> HTMLResponse:
        return HTMLResponse(page, headers={"content-security-policy": "frame-ancestors 'none'"})  # it has its own

    with WebServer(Starlette(routes=[Route("/", report)]), SessionKey.new(), port=port) as server:
        announce(server.addresses[0])
        threading.Event().wait()
