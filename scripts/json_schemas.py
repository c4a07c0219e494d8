"""Writes the JSON schemas of docs/schemas whose objects are declared: as measures, quantities of a record, movements.

    python scripts/json_schemas.py [DIRECTORY]

Other objects of these files, and the schemas of other commands, are written by hand.
"""

import json
import sys
import textwrap
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from scripts import movements
from vsnbench.cli.judging.judge import PENDING_FIELDS
from vsnbench.cli.running.stress_summary import STRESS
from vsnbench.cli.study.text import PLAN
from vsnbench.report.analysis.courses import CourseMeasures
from vsnbench.report.diagnosis import TRIED
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
from vsnbench.results.fields import Field, Fields, fields_of
from vsnbench.results.model import CAMPAIGN, EPISODE, EPISODE_RECORD
from vsnbench.results.step_fields import STEP
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
_DIRECTORY = Field("directory", str | None, "directory of the episode's files", absent="without files")
_PROPOSED = (
    Field("proposal", str | None, "the protocol's proposed verdict in words", absent="for an import"),
    Field("proposed_success", bool | None, "proposed success", absent="without a proposal or for void"),
)
_WIDTH = 130


def schemas(written: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schemas with declared objects by file, without suffix.

    `written` are the schemas of docs/schemas, whose other objects are kept.
    """
    adapter = deepcopy(written["motion-adapter"])
    adapter["$defs"]["card"]["properties"]["movements"]["items"]["enum"] = movements.adapter_kinds()
    return _of_measures(written["common"]) | _of_quantities(written) | {"motion-adapter": adapter}


def _of_measures(common: Mapping[str, Any]) -> dict[str, Any]:
    objects = {measures.common: measures.schema for measures in COMMON} | {"movement": movements.schema()}
    found: dict[str, Any] = {"common": {**common, "$defs": dict(sorted((common["$defs"] | objects).items()))}}
    for file, (title, forms) in COMMANDS.items():
        several = [({"description": when} if when else {}) | measures.schema for when, measures in forms.items()]
        head = {"$schema": common["$schema"], "title": title}
        found[file] = {**head, **(several[0] if len(several) == 1 else {"oneOf": several})}
    return found


def _of_quantities(written: Mapping[str, Any]) -> dict[str, Any]:
    shown = Fields([*EPISODE_RECORD, *fields_of(CourseMeasures), _DIRECTORY]).schema()
    steps = {"type": "array", "items": STEP.schema(), "description": "one object per step, in order"}
    shown["properties"]["steps"] = steps
    shown["required"].append("steps")
    found = {
        "episodes-list": written["episodes-list"] | {"items": EPISODE.schema()},
        "episodes-show": written["episodes-show"] | shown,
        "db-status": deepcopy(written["db-status"]),
        "judge": deepcopy(written["judge"]),
        "try": deepcopy(written["try"]),
    }
    found["try"]["properties"]["trials"]["items"] = TRIED.schema()
    found["db-status"]["properties"]["campaigns"]["items"] = CAMPAIGN.schema()
    found["judge"]["oneOf"][1]["items"] = Fields([*EPISODE.only(*PENDING_FIELDS), *_PROPOSED]).schema()
    return found


def read_schemas(directory: Path = SCHEMAS) -> dict[str, Any]:
    """Return the schemas of a directory by file, without suffix."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in directory.glob("*.json")}


def layout(value: Any, indent: int = 0, key: str = "") -> str:
    """Return JSON with one value a line, and on one line what fits, after the key and its indentation."""
    short = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or (indent and len(key) + len(short) + indent <= _WIDTH - 1):
        return short
    pad = " " * (indent + 1)
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        lines = textwrap.wrap(short[1:-1], _WIDTH - indent, break_long_words=False, break_on_hyphens=False)
        return "[\n" + "\n".join(pad + line for line in lines) + f"\n{' ' * indent}]"
    if isinstance(value, list):
        return "[\n" + ",\n".join(pad + layout(item, indent + 1) for item in value) + f"\n{' ' * indent}]"
    keyed = ((f"{json.dumps(name)}: ", item) for name, item in value.items())
    items = (f"{pad}{name}{layout(item, indent + 1, name)}" for name, item in keyed)
    return "{\n" + ",\n".join(items) + f"\n{' ' * indent}}}"


def main(directory: Path = SCHEMAS) -> None:
    """Write the schemas into a directory that has all of them."""
    for file, schema in schemas(read_schemas(directory)).items():
        (directory / f"{file}.json").write_text(f"{layout(schema)}\n", encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
