"""The record as pandas DataFrames, for questions that no report answers.

from vsnbench.report.frames import episodes, steps
counted = episodes("results").query("state == 'counted'")
counted.groupby(["model", "goal"])["success"].agg(["sum", "count", "mean"])
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import select

from vsnbench.database.engine import record_errors
from vsnbench.database.migrate import open_record
from vsnbench.database.tables import Step
from vsnbench.database_url import sqlite_url
from vsnbench.report.record import Selection, read_record

if TYPE_CHECKING:
    import pandas as pd


def episodes(record: str | Path, selection: Selection | None = None) -> "pd.DataFrame":
    """Return one row an episode.

    Columns: those of `vsnbench.report.record.COLUMNS`, which says what each holds, and `model`, `weights_label`,
    `robot`, `environment` (`real` or `simulated`) and `site`. `state` is `counted` for the one result of its trial;
    rates are over those alone.

    Args:
        record: a results directory, or the URL of a database.
        selection: which part of it; everything when None.

    Raises:
        RecordError: there is no record, or it cannot be read.
    """
    with open_record(_url(record)) as engine:
        found = read_record(engine, selection)
    frame = found.episodes.copy()
    by_number = {one.number: one for one in found.conditions}
    frame["model"] = frame["condition"].map({number: one.model for number, one in by_number.items()})
    frame["weights_label"] = frame["condition"].map({number: one.weights_label for number, one in by_number.items()})
    frame["robot"] = frame["condition"].map({number: one.robot for number, one in by_number.items()})
    frame["environment"] = frame["condition"].map({number: one.environment for number, one in by_number.items()})
    frame["site"] = frame["condition"].map({number: one.site for number, one in by_number.items()})
    return frame


def steps(record: str | Path, numbers: Sequence[int]) -> "pd.DataFrame":
    """Return one row a step of the episodes with these numbers, ordered by episode and step.

    Columns: those of the table `step` (docs/schema.md) without its JSON: distances in metres, angles in radians,
    times in seconds; NaN for what is unknown.

    Args:
        record: a results directory, or the URL of a database.
        numbers: of the episodes.

    Raises:
        RecordError: there is no record, or it cannot be read.
    """
    import pandas as pd

    wanted = [column for column in Step.__table__.columns if column.name not in ("probabilities", "details")]
    with open_record(_url(record)) as engine, record_errors(engine), engine.connect() as connection:
        rows = connection.execute(
            select(*wanted).where(Step.episode_id.in_(list(numbers))).order_by(Step.episode_id, Step.number)
        ).all()
    return pd.DataFrame([tuple(row) for row in rows], columns=[column.name for column in wanted])


def _url(record: str | Path) -> str:
    return str(record) if "://" in str(record) else sqlite_url(Path(record) / "vsnbench.db")
