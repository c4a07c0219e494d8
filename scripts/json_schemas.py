"""Writes the JSON schemas of docs/schemas whose objects are declared as measures.

    python scripts/json_schemas.py [DIRECTORY]

Objects of common.json that are declared elsewhere, and the schemas of other commands, are written by hand.
"""

import json
import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsnbench.cli.running.stress_summary import STRESS
from vsnbench.cli.study.text import PLAN
from vsnbench.report.formats.json import COMPARED, MODEL, REPORT
from vsnbench.report.measures import Measures
from vsnbench.report.output import FILES
from vsnbench.report.study.forms import STUDY
from vsnbench.report.tables.comparison import COMPARISON
from vsnbench.report.tables.conditions import CONDITION
from vsnbench.report.tables.ranking import RANKING
from vsnbench.report.tables.sensitivity import DRIFT, RECOUNT
from vsnbench.report.tables.sim_vs_real import SIM_VS_REAL
from vsnbench.report.tables.success import GROUP
from vsnbench.web.results_browser.website import HEADLINES, WEBSITE

SCHEMAS = Path(__file__).parents[1] / "docs" / "schemas"
COMMON = (COMPARISON, MODEL, CONDITION, DRIFT, RANKING, RECOUNT, SIM_VS_REAL, GROUP)
"""Objects of common.json."""
COMMANDS: dict[str, tuple[str, dict[str, Measures]]] = {
    "compare": ("vsnbench compare --json", {"": COMPARED}),
    "headline": ("headline.json of `vsnbench report --website`", {"": HEADLINES}),
    "report": ("vsnbench report --json", {"": REPORT, "with --output": FILES, "with --website": WEBSITE}),
    "stress": ("vsnbench stress --json", {"": STRESS}),
    "study-plan": ("vsnbench study plan --json", {"": PLAN}),
    "study-report": ("vsnbench study report --json", {"": STUDY, "with --output": FILES}),
}
"""File -> title and objects, with the option that each needs."""
_WIDTH = 120


def schemas(common: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the schemas by file, without suffix; `common` is common.json, whose other objects are kept."""
    objects = {measures.common: measures.schema for measures in COMMON}
    found = {"common": {**common, "$defs": dict(sorted((common["$defs"] | objects).items()))}}
    for file, (title, forms) in COMMANDS.items():
        several = [({"description": when} if when else {}) | measures.schema for when, measures in forms.items()]
        head = {"$schema": common["$schema"], "title": title}
        found[file] = {**head, **(several[0] if len(several) == 1 else {"oneOf": several})}
    return found


def layout(value: Any, indent: int = 0) -> str:
    """Return JSON with one value a line, and on one line what fits."""
    short = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or (indent and len(short) + indent <= _WIDTH - 5):
        return short
    pad = " " * (indent + 1)
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        lines = textwrap.wrap(short[1:-1], _WIDTH - indent, break_long_words=False, break_on_hyphens=False)
        return "[\n" + "\n".join(pad + line for line in lines) + f"\n{' ' * indent}]"
    if isinstance(value, list):
        return "[\n" + ",\n".join(pad + layout(item, indent + 1) for item in value) + f"\n{' ' * indent}]"
    items = (f"{pad}{json.dumps(key)}: {layout(item, indent + 1)}" for key, item in value.items())
    return "{\n" + ",\n".join(items) + f"\n{' ' * indent}}}"


def main(directory: Path = SCHEMAS) -> None:
    """Write the schemas into a directory that has a common.json."""
    common = json.loads((directory / "common.json").read_text(encoding="utf-8"))
    for file, schema in schemas(common).items():
        (directory / f"{file}.json").write_text(f"{layout(schema)}\n", encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
