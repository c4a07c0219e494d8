"""Writes a whole report into a directory: the page, the tables in every form, the figures; and serves the page."""

from collections.abc import Callable, Sequence
from pathlib import Path

from vsnbench import loopback
from vsnbench.errors import RecordError
from vsnbench.report.build import Report
from vsnbench.report.figures.style import COLUMN_IN, Drawing
from vsnbench.report.forms.html import html_page
from vsnbench.report.forms.latex import document, latex
from vsnbench.report.forms.markdown import markdown
from vsnbench.report.forms.plain import to_csv
from vsnbench.report.forms.whole_json import to_json
from vsnbench.whole_files import write_whole


def write_report(report: Report, drawings: Sequence[Drawing], directory: Path) -> tuple[Path, ...]:
    """Write everything there is and return the files.

    `report.html` stands alone; `report.md`, `report.csv`, `report.json`; `tables.tex` to paste into a paper and
    `report.tex` to compile; `figures/` with SVG, PDF and PNG of each figure.

    Raises:
        RecordError: the directory cannot be written.
    """
    sheets = report.sheets(long=True)
    figures = [
        (f"figures/{each.name}.pdf", each.width_in > 1.2 * COLUMN_IN, f"{each.title}. {each.caption}")
        for each in drawings
    ]
    files: dict[str, bytes] = {
        "report.html": html_page(report, sheets, drawings).encode(),
        "report.md": markdown(sheets).encode(),
        "report.csv": to_csv(report.results).encode(),
        "report.json": to_json(
            report.results, report.questions, report.activity, report.record, report.attended
        ).encode(),
        "tables.tex": latex(sheets).encode(),
        "report.tex": document(sheets, figures).encode(),
    }
    for drawing in drawings:
        files[f"figures/{drawing.name}.svg"] = drawing.svg()
        files[f"figures/{drawing.name}.pdf"] = drawing.pdf()
        files[f"figures/{drawing.name}.png"] = drawing.png()
    for name, content in files.items():
        write_whole(directory / name, content)
    return tuple(directory / name for name in files)


def serve_page(page: str, port: int, announce: Callable[[str], None]) -> None:
    """Serve the page on 127.0.0.1 until interrupted; nothing else is served, and only to who has the address.

    Args:
        page: the HTML.
        port: 0 for any that is free.
        announce: is told the address once it answers.

    Raises:
        RecordError: the port is taken.
    """
    answer = loopback.page(page.encode(), "text/html; charset=utf-8")

    def site(path: str, _query: str) -> loopback.Answer:
        return answer if path in ("", "report.html") else loopback.NOT_FOUND

    try:
        server = loopback.LoopbackServer(port, site)
    except OSError as error:
        raise RecordError(
            f"cannot serve on port {port}: {error.strerror or error}", advice="choose another --port"
        ) from error
    with server:
        announce(server.address)
        server.serve_forever()
