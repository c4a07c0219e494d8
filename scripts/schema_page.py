"""Generates docs/schema.md from the table classes.

usage: python scripts/schema_page.py
"""

import ast
import inspect
from pathlib import Path

from sqlalchemy import Column, Table
from sqlalchemy.dialects import sqlite

from vsnbench.results.reading import episode_numbers
from vsnbench.results.schema import placement_tables, study_tables, tables

PAGE = Path(__file__).parent.parent / "docs" / "schema.md"

LATEST_VERDICT = """LEFT JOIN verdict v ON e.state <> 'awaiting'
  AND v.id = (SELECT max(id) FROM verdict WHERE episode_id = e.id AND NOT proposed)"""
FIRST_RESULTS = """WITH result AS (
  SELECT min(id) AS id FROM episode WHERE state IN ('judged', 'awaiting') GROUP BY trial_id)"""

QUERIES: tuple[tuple[str, str], ...] = (
    (
        "Success rate by model and goal: current verdicts of the first result of each trial",
        f"""{FIRST_RESULTS}
SELECT m.name AS model, t.goal, sum(v.success) AS successes, count(*) AS episodes,
       round(100.0 * sum(v.success) / count(*), 2) AS percent
FROM result r JOIN episode e ON e.id = r.id {LATEST_VERDICT}
JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id JOIN model m ON m.id = c.model_id
WHERE v.success IS NOT NULL GROUP BY m.id, m.name, t.goal ORDER BY m.name, t.goal;""",
    ),
    (
        "How episodes ended",
        f"""SELECT m.name AS model, coalesce(v.end_reason, e.end_reason) AS end_reason, count(*) AS attempts
FROM episode e {LATEST_VERDICT}
JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id JOIN model m ON m.id = c.model_id
WHERE e.end_reason IS NOT NULL GROUP BY m.id, m.name, coalesce(v.end_reason, e.end_reason) ORDER BY 1, 3 DESC;""",
    ),
    (
        "Starting positions that never succeed",
        f"""{FIRST_RESULTS}
SELECT m.name AS model, t.start FROM result r JOIN episode e ON e.id = r.id {LATEST_VERDICT}
JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id JOIN model m ON m.id = c.model_id
WHERE v.success IS NOT NULL GROUP BY m.id, m.name, t.start HAVING sum(v.success) = 0 ORDER BY 1, 2;""",
    ),
    (
        "Trials left, by campaign",
        """SELECT c.id, c.name, count(*) AS trials_left FROM trial t JOIN campaign c ON c.id = t.campaign_id
WHERE NOT EXISTS (SELECT 1 FROM episode e WHERE e.trial_id = t.id AND e.state <> 'void')
GROUP BY c.id, c.name ORDER BY c.id;""",
    ),
    (
        "Histogram of actions: chosen, executed, blocked (paper, Figure 9)",
        """SELECT m.name AS model, s.raw_action, s.action, s.blocked, count(*) AS steps
FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
JOIN campaign c ON c.id = t.campaign_id JOIN model m ON m.id = c.model_id
GROUP BY m.id, m.name, s.raw_action, s.action, s.blocked ORDER BY 1, 5 DESC;""",
    ),
    (
        "Hours, kilometres and attempts by robot (paper, Table 6)",
        """SELECT r.name AS robot, r.simulated, count(*) AS attempts, round(sum(e.duration_s) / 3600.0, 2) AS hours,
       round(sum(e.path_length_m) / 1000.0, 3) AS kilometres
FROM episode e JOIN trial t ON t.id = e.trial_id JOIN campaign c ON c.id = t.campaign_id
JOIN robot r ON r.id = c.robot_id WHERE e.end_reason IS NOT NULL GROUP BY r.id, r.name, r.simulated;""",
    ),
    (
        "Objects touched in collisions",
        """SELECT s.collision_source, s.collision_touched, count(*) AS times FROM step s
WHERE s.collision_source IS NOT NULL GROUP BY s.collision_source, s.collision_touched ORDER BY times DESC;""",
    ),
    (
        "Near misses: STOP slightly too far from the goal",
        f"""SELECT e.id, t.goal, t.start, coalesce(v.distance_m, e.distance_to_goal_m) AS metres
FROM episode e {LATEST_VERDICT} JOIN trial t ON t.id = e.trial_id
WHERE v.end_reason = 'stop' AND NOT v.success AND coalesce(v.distance_m, e.distance_to_goal_m) < 1.5
ORDER BY metres;""",
    ),
    (
        "All verdicts of episodes with more than one: proposals, judgements, corrections",
        """SELECT v.episode_id, v.created_at, v.author, v.source, v.proposed, v.end_reason, v.success, v.reason, v.note
FROM verdict v
WHERE v.episode_id IN (SELECT episode_id FROM verdict GROUP BY episode_id HAVING count(*) > 1)
ORDER BY v.episode_id, v.id;""",
    ),
    (
        "Operators, sessions, and offsets from the marks in centimetres",
        """SELECT s.id, s.operator, s.began_at, count(*) AS attempts,
       round(avg(100 * abs(p.ahead_m)), 1) AS ahead, round(avg(100 * abs(p.left_m)), 1) AS aside
FROM session s JOIN episode e ON e.session_id = s.id LEFT JOIN placement p ON p.episode_id = e.id
GROUP BY s.id, s.operator, s.began_at ORDER BY s.id;""",
    ),
    (
        "Parts of a step's time, seconds",
        """SELECT m.name AS model, round(avg(s.sense_s), 4) AS sense, round(avg(s.infer_s), 4) AS infer,
       round(avg(s.move_s), 4) AS move
FROM step s JOIN episode e ON e.id = s.episode_id JOIN trial t ON t.id = e.trial_id
JOIN campaign c ON c.id = t.campaign_id JOIN model m ON m.id = c.model_id GROUP BY m.id, m.name;""",
    ),
)


_LEAD = (
    "Generated from the code by `make docs`. `vsnbench db path` prints the path of the database, which can be read "
    "during a run. Times are UTC, poses follow REP-103 (metres, radians), unknown values are NULL."
)
_DRAWING = """```
site  robot  model            process (the writer)
  \\     |     /                    |
     campaign ── trial ── episode ── step
                             ├── placement (measured), session (operator)
                             ├── verdict (the latest counts)
                             └── event
```"""


def schema_page() -> str:
    """Return the page."""
    meanings = _meanings()
    parts = [
        "# The tables of a record",
        _LEAD,
        _DRAWING,
        "For pandas use `vsnbench.open_results` ([Python interface](api.md)).",
    ]
    for table in tables.TableBase.metadata.sorted_tables:
        parts += _table(table, meanings)
    parts.append("## Eleven questions in SQL")
    parts.append("For SQLite. On PostgreSQL replace `sum(v.success)` by `sum(v.success::int)`.")
    for title, query in QUERIES:
        parts += [f"### {title}", f"```sql\n{query}\n```"]
    return "\n\n".join(parts) + "\n"


def _table(table: Table, meanings: dict[tuple[str, str], str]) -> list[str]:
    rows = ["| column | type | | meaning |", "| --- | --- | --- | --- |"]
    for column in table.columns:
        kind = column.type.compile(dialect=sqlite.dialect())
        meaning = meanings.get((table.name, column.name), "").replace("|", "\\|")
        rows.append(f"| {column.name} | {kind} | {_marks(column)} | {meaning} |")
    indexes = sorted(
        f"`{index.name}` ({', '.join(column.name for column in index.columns)})" for index in table.indexes
    )
    parts = [f"## {table.name}", meanings[table.name, ""], "\n".join(rows)]
    return [*parts, f"Indexes: {', '.join(indexes)}."] if indexes else parts


def _marks(column: "Column[object]") -> str:
    marks = ["key"] if column.primary_key else []
    marks += [f"→ {key.target_fullname}" for key in column.foreign_keys]
    marks += ["unique"] if column.unique else []
    marks += ["may be NULL"] if column.nullable else []
    return ", ".join(marks)


def _meanings() -> dict[tuple[str, str], str]:
    """Read the docstrings of tables and columns from the source; columns have none at run time."""
    found: dict[tuple[str, str], str] = {}
    sources = (tables, placement_tables, study_tables, episode_numbers)
    for node in (node for source in sources for node in ast.parse(inspect.getsource(source)).body):
        if not isinstance(node, ast.ClassDef):
            continue
        names = [
            statement.value.value
            for statement in node.body
            if isinstance(statement, ast.Assign)
            and isinstance(statement.targets[0], ast.Name)
            and statement.targets[0].id == "__tablename__"
            and isinstance(statement.value, ast.Constant)
        ]
        if not names:
            continue
        table = str(names[0])
        found[table, ""] = " ".join((ast.get_docstring(node) or "").split())
        for before, after in zip(node.body, node.body[1:], strict=False):
            if (
                isinstance(before, ast.AnnAssign)
                and isinstance(before.target, ast.Name)
                and isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
                and isinstance(after.value.value, str)
            ):
                found[table, before.target.id] = " ".join(after.value.value.split())
    return found


if __name__ == "__main__":
    PAGE.write_text(schema_page(), encoding="utf-8")
    print(PAGE)
