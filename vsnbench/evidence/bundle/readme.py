"""The README of a bundle: what it contains and how to check it."""

from dataclasses import dataclass

from vsnbench.report.formats.markdown import escaped


@dataclass(frozen=True, slots=True)
class BundleAbout:
    """What a bundle says about itself."""

    title: str
    description: str
    date: str
    """Date of the newest row of the record, as YYYY-MM-DD: equal records make equal bundles."""
    authors: tuple[str, ...]
    licence: str
    """SPDX identifier, URL or text; empty if the authors have not stated one."""
    citation: str


def readme(about: BundleAbout, *, with_images: bool) -> str:
    """Return the README in Markdown."""
    images = "The images are those that the robot recorded." if with_images else "The images were left out."
    lines = [f"# {escaped(about.title)}", escaped(about.description), images]
    if about.authors:
        lines.append(f"Authors: {escaped(', '.join(about.authors))}.")
    lines.append(f"Licence: {escaped(about.licence) or 'not stated; ask the authors'}.")
    lines.append(f"Please cite: {escaped(about.citation)}")
    return "\n\n".join([*lines, _CONTENT]) + "\n"


_CONTENT = """\
## Content

| file | content |
| --- | --- |
| `report/` | success rates, intervals and comparisons, as JSON, CSV and Markdown; for a study its conclusion |
| `tables/` | campaigns, episodes, steps and verdicts as CSV, described in `croissant.json` |
| `conditions/` | each site, robot and model as recorded |
| `study/` | plan of the study, as locked or last amended |
| `environment.json` | the commands that ran the episodes, and their packages |
| `scans/`, `weights/` | scans of sites and weights of models, if they were added |
| `results/` | the record: a results directory of vsnbench |
| `manifest-sha256.txt` | SHA-256 of every file; signatures are made of this file |

## Check it

With vsnbench, which also judges every episode again and rebuilds every table:

    vsnbench verify FILE

Without it, in the unpacked directory:

    sha256sum --check --quiet manifest-sha256.txt

To look at the episodes: `vsnbench browse --results results`, or `vsnbench report --results results`."""
