"""docs/survey-mistakes.md: what people get wrong in a survey, each with the message that `sites check` gives it."""

import tempfile
from pathlib import Path

from tests.protocol.survey.mistakes import MISTAKES, RADIUS_M, Mistake
from vsnbench.protocol.survey.check import check_site_file

PREAMBLE = """# Mistakes of surveys

Slips that people make, each made on a sound flat of two rooms (`tests/protocol/survey/flat.yaml`), with the message
that `vsnbench sites check` gives it. Where a slip has several findings, the one that leads to the mend is here. This
page is made by `make docs`, and a test keeps it equal to what the check says.

| the slip | what `sites check` says |
| --- | --- |
"""


def row(mistake: Mistake, folder: Path) -> str:
    """Make the mistake in a file in `folder`, and return its line of the table.

    Raises:
        LookupError: the check does not say what it should.
    """
    path = mistake.file(folder)
    _, findings = check_site_file(path, RADIUS_M)
    for finding in findings:
        if finding.code == mistake.code and mistake.says in finding.message:
            words = finding.message.replace(str(path), path.name).replace("|", "\\|").replace("<", "&lt;")
            return f"| {mistake.what} | {finding.severity.value}: {words} |\n"
    raise LookupError(f"{mistake.what}: {[(finding.code, finding.message) for finding in findings]}")


def mistakes_page() -> str:
    """Return docs/survey-mistakes.md."""
    with tempfile.TemporaryDirectory() as folder:
        return PREAMBLE + "".join(row(mistake, Path(folder)) for mistake in MISTAKES)
