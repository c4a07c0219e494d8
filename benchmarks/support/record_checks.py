"""Checks of a record on PostgreSQL after processes were killed: is each trial run once, and is nothing torn?"""

from sqlalchemy import Engine, text

FAULTS = {
    "trials without a result": (
        "SELECT count(*) FROM trial WHERE NOT EXISTS (SELECT 1 FROM episode WHERE trial_id = trial.id AND state = "
        "'judged')"
    ),
    "trials with two results": (
        "SELECT count(*) FROM (SELECT trial_id FROM episode WHERE state = 'judged' GROUP BY trial_id HAVING count(*) > "
        "1) AS twice"
    ),
    "episodes still active": "SELECT count(*) FROM episode WHERE state IN ('claimed', 'placed', 'running')",
    "episodes with other steps than actions": (
        "SELECT count(*) FROM episode WHERE actions <> (SELECT count(*) FROM step WHERE episode_id = episode.id)"
    ),
    "steps written after their episode was closed elsewhere": (
        "SELECT count(*) FROM step JOIN event ON event.episode_id = step.episode_id WHERE kind = 'recovered' AND "
        "recorded_at > created_at"
    ),
}
"""Name -> query of a number that must be 0 when every trial has been run."""
TOTALS = {
    "trials": "SELECT count(*) FROM trial",
    "episodes judged": "SELECT count(*) FROM episode WHERE state = 'judged'",
    "episodes void": "SELECT count(*) FROM episode WHERE state = 'void'",
    "episodes that ended interrupted": "SELECT count(*) FROM episode WHERE end_reason = 'interrupted'",
    "campaigns": "SELECT count(*) FROM campaign",
}


def count(engine: Engine, query: str) -> int:
    """Return the number that a query gives."""
    with engine.connect() as connection:
        return int(connection.execute(text(query)).scalar_one())


def print_totals(engine: Engine) -> dict[str, int]:
    """Print and return what the record holds."""
    return _printed({name: count(engine, query) for name, query in TOTALS.items()})


def print_faults(engine: Engine, left_out: tuple[str, ...] = ()) -> list[str]:
    """Print the number of each fault; return those that occur.

    Args:
        engine: of the record.
        left_out: faults that are not looked for.
    """
    found = _printed({name: count(engine, query) for name, query in FAULTS.items() if name not in left_out})
    return [f"{number} {name}" for name, number in found.items() if number]


def _printed(found: dict[str, int]) -> dict[str, int]:
    for name, number in found.items():
        print(f"{number:7d} {name}")
    return found
