"""Recorded results as pandas DataFrames.

from vsnbench import open_results

episodes = open_results("results").episodes()
counted = episodes.query("state == 'counted'")
counted.groupby(["model", "goal"])["success"].agg(["sum", "count", "mean"])
"""

from collections.abc import Iterable, Mapping
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from vsnbench.errors import UsageError
from vsnbench.report.analysis.episodes_frame import read_report_data
from vsnbench.results.database_url import sqlite_url
from vsnbench.results.reading.blinding import HIDDEN_COLUMNS, blind_episodes
from vsnbench.results.schema.engine import record_errors
from vsnbench.results.schema.migrate import open_record
from vsnbench.results.schema.tables import EpisodeRow, StepRow

if TYPE_CHECKING:
    import pandas as pd

CAMPAIGN_COLUMNS = {
    "campaign": "number of the campaign",
    "condition": "number of the condition: campaigns with the same number differ only in their seed",
    "model": "name of the model",
    "weights_label": "description of its weights",
    "robot": "name of the robot's profile",
    "environment": "`real` or `simulated`",
    "site": "name of the site",
    "seed": "seed of the campaign",
}
"""Columns of `Results.campaigns`."""
_IN_ONE_QUERY = 10_000  # SQLite allows 32,766 values
_OF_EPISODES = ("model", "weights_label", "robot", "environment", "site")


class Results:
    """Read-only access to the results of experiments. Every call reads the database again.

    Models of a blind study appear under their codes.
    """

    def __init__(self, url: str) -> None:
        """Open results.

        Raises:
            RecordError: the database does not exist or cannot be read.
        """
        self._url = url
        with open_record(url):
            pass

    def episodes(self) -> "pd.DataFrame":
        """Return one row per episode.

        The columns are those of `vsnbench.report.analysis.episodes_frame.COLUMNS`, and `model`, `weights_label`,
        `robot`, `environment` and `site` as in `campaigns`. Success rates use only the rows whose `state` is `counted`.

        Raises:
            RecordError: the database cannot be read.
        """
        with open_record(self._url) as engine:
            record = read_report_data(engine)
        frame = record.episodes.copy()
        for name in _OF_EPISODES:
            frame[name] = frame["condition"].map({item.number: getattr(item, name) for item in record.conditions})
        return frame

    def campaigns(self) -> "pd.DataFrame":
        """Return one row per campaign. The columns are those of `CAMPAIGN_COLUMNS`.

        Raises:
            RecordError: the database cannot be read.
        """
        import pandas as pd

        with open_record(self._url) as engine:
            conditions = read_report_data(engine).conditions
        rows = [
            (campaign, condition.number, *(getattr(condition, name) for name in _OF_EPISODES), seed)
            for condition in conditions
            for campaign, seed in zip(condition.campaigns, condition.seeds, strict=True)
        ]
        return pd.DataFrame(sorted(rows), columns=list(CAMPAIGN_COLUMNS))

    def steps(self, *episodes: int | Iterable[int]) -> "pd.DataFrame":
        """Return one row per step, in the order of episodes and steps.

        The columns are those of the table `step` (docs/schema.md) without JSON: distances in metres, angles in radians,
        times in seconds, NaN for unknown values. Arms of a blind study have neither times nor the model's own words.

        Args:
            episodes: numbers of episodes, or lists, arrays or columns of them. Without any, the steps of all episodes.

        Raises:
            UsageError: an argument is neither a number nor a list of numbers.
            RecordError: the database cannot be read.
        """
        import pandas as pd

        numbers = _episode_numbers(episodes)
        columns = [column for column in StepRow.__table__.columns if column.name not in ("probabilities", "details")]
        query = select(*columns).order_by(StepRow.episode_id, StepRow.number)
        with open_record(self._url) as engine, record_errors(engine), engine.connect() as connection:
            if not episodes:
                rows = list(connection.execute(query))
            else:
                known = sorted(numbers.intersection(connection.scalars(select(EpisodeRow.id))))
                parts = [known[first : first + _IN_ONE_QUERY] for first in range(0, len(known), _IN_ONE_QUERY)]
                rows = [row for part in parts for row in connection.execute(query.where(StepRow.episode_id.in_(part)))]
            blind = blind_episodes(connection)
        frame = pd.DataFrame([tuple(row) for row in rows], columns=[column.name for column in columns])
        hidden = frame["episode_id"].isin(blind)
        frame["raw_action"] = frame["raw_action"].where(~hidden, frame["action"])
        for name in HIDDEN_COLUMNS & set(frame.columns):
            frame[name] = frame[name].where(~hidden)
        drives_on = hidden & frame["movement"].map(
            lambda movement: isinstance(movement, Mapping) and "answer" in movement
        )
        frame["duration_s"] = frame["duration_s"].where(~drives_on)
        frame.loc[drives_on, "movement"] = frame.loc[drives_on, "movement"].map(_without_times)
        return frame


def _without_times(movement: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a column `movement` without what would reveal how long the model thinks."""
    return {name: value for name, value in movement.items() if name not in ("answer", "waiting_s")}


def _episode_numbers(episodes: tuple[int | Iterable[int], ...]) -> set[int]:
    try:
        return {
            index(number)
            for given in episodes
            for number in (given if isinstance(given, Iterable) and not isinstance(given, str) else (given,))
        }
    except TypeError as error:
        raise UsageError(f"episodes are whole numbers: {error}", advice="write steps(2, 3) or steps([2, 3])") from error


def open_results(results: str | Path) -> Results:
    """Open results for reading.

    Args:
        results: results directory, or URL of a database.

    Raises:
        RecordError: the results do not exist or cannot be read.
    """
    return Results(str(results) if "://" in str(results) else sqlite_url(Path(results) / "vsnbench.db"))
