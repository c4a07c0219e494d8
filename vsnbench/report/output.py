"""Writes a report into a directory (page, tables in every format, figures) and serves the page."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from vsnbench.files.atomic import write_atomic
from vsnbench.report.build import Report
from vsnbench.report.figures.style import Drawing
from vsnbench.report.formats.csv import to_csv
from vsnbench.report.formats.html import html_page
from vsnbench.report.formats.json import to_json
from vsnbench.report.formats.latex import document, latex
from vsnbench.report.formats.markdown import markdown


def write_report(report: Report, drawings: Sequence[Drawing], directory: Path) -> tuple[Path, ...]:
    """Write all files of a report and return their paths.

    `report.html` (self-contained), `report.md`, `report.csv`, `report.json`, `tables.tex` to paste into a paper,
    `report.tex` to compile, and `figures/` with SVG, PDF and PNG of each figure.

    Raises:
        RecordError: the directory cannot be written.
    """
    tables = report.tables(long=True)
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
        "tables.tex": latex(tables).encode(),
        "report.tex": document(tables, figures).encode(),
    }
    for drawing in drawings:
        files[f"figures/{drawing.name}.svg"] = drawing.svg()
        files[f"figures/{drawing.name}.pdf"] = drawing.pdf()
        files[f"figures/{drawing.name}.png"] = drawing.png()
    for name, content in files.items():
        write_atomic(directory / name, content)
    return tuple(directory / name for name in files)


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
