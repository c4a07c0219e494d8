"""Generates the JSON schemas of episodes and campaigns from the declarations of their quantities.

usage: python scripts/record_schemas.py
"""

import json
import textwrap
from pathlib import Path
from typing import Any

from vsnbench.cli.judging.judge import PENDING_FIELDS
from vsnbench.report.analysis.courses import CourseMeasures
from vsnbench.results.fields import Field, Fields, fields_of
from vsnbench.results.model import CAMPAIGN, EPISODE, EPISODE_RECORD
from vsnbench.results.step_fields import STEP

SCHEMAS = Path(__file__).parent.parent / "docs" / "schemas"
_WIDTH = 130
_DIRECTORY = Field("directory", str | None, "directory of the episode's files", absent="without files")
_PROPOSED = (
    Field("proposal", str | None, "the protocol's proposed verdict in words", absent="for an import"),
    Field("proposed_success", bool | None, "proposed success", absent="without a proposal or for void"),
)


def schemas() -> dict[str, str]:
    """Return the name of each file in docs/schemas that has declared quantities, and its content."""
    shown = Fields([*EPISODE_RECORD, *fields_of(CourseMeasures), _DIRECTORY]).schema()
    shown["properties"]["steps"] = {
        "type": "array",
        "items": STEP.schema(),
        "description": "one object per step, in order",
    }
    shown["required"].append("steps")
    pending = Fields([*EPISODE.only(*PENDING_FIELDS), *_PROPOSED]).schema()
    found = {
        "episodes-list": _read("episodes-list") | {"items": EPISODE.schema()},
        "episodes-show": _read("episodes-show") | shown,
        "db-status": _read("db-status"),
        "judge": _read("judge"),
    }
    found["db-status"]["properties"]["campaigns"]["items"] = CAMPAIGN.schema()
    found["judge"]["oneOf"][1]["items"] = pending
    return {name: text_of(content) + "\n" for name, content in found.items()}


def text_of(value: Any, indent: int = 0, before: int = 0) -> str:
    """Return JSON in which what fits into a line stands in one.

    Args:
        value: what to write.
        indent: number of spaces before the lines of its parts.
        before: number of characters before it in its line.
    """
    short = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or len(short) + before + 1 <= _WIDTH:
        return short
    pad = " " * (indent + 1)
    if isinstance(value, list) and all(isinstance(part, str) for part in value):
        words = [f"{json.dumps(part, ensure_ascii=False)}," for part in value]
        lines = textwrap.wrap(" ".join(words)[:-1], _WIDTH - 10, initial_indent=pad, subsequent_indent=pad)
        return "\n".join(["[", *lines, f"{' ' * indent}]"])
    parts = []
    for key, part in value.items() if isinstance(value, dict) else ((None, part) for part in value):
        name = "" if key is None else f"{json.dumps(key, ensure_ascii=False)}: "
        parts.append(f"{pad}{name}{text_of(part, indent + 1, len(pad) + len(name))}")
    first, last = "{}" if isinstance(value, dict) else "[]"
    return f"{first}\n" + ",\n".join(parts) + f"\n{' ' * indent}{last}"


def _read(name: str) -> Any:
    return json.loads((SCHEMAS / f"{name}.json").read_text(encoding="utf-8"))


def main() -> None:
    """Write the files."""
    for name, text in schemas().items():
        (SCHEMAS / f"{name}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
