"""A verification as a page: what was checked, what could not be, what does not hold, and by which version."""

from pathlib import Path

from vsnbench.evidence.verification.checks import Verification
from vsnbench.files.atomic import atomic_file
from vsnbench.report.formats.html import page_environment, page_part

MAX_FINDINGS = 1000
"""Findings on the page; the JSON output has all."""


def write_page(found: Verification, file: Path) -> None:
    """Write a self-contained HTML page without scripts."""
    from markupsafe import Markup

    findings = [finding for check in found.checks for finding in check.findings]
    text = (
        page_environment()
        .get_template("verification.html.j2")
        .render(
            found=found,
            findings=findings[:MAX_FINDINGS],
            more=max(0, len(findings) - MAX_FINDINGS),
            style=Markup(page_part("page.css")),  # noqa: S704 - our own file, not text from the record
        )
    )
    with atomic_file(file) as part:
        part.write_text(text, encoding="utf-8")
