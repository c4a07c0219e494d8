"""Recorded names of models and goals, to validate arguments."""

from sqlalchemy import Engine, select

from vsnbench.results.reading.blinding import MODEL_NAME
from vsnbench.results.reading.read_model import episodes_of_campaigns
from vsnbench.results.schema.engine import reading, record_errors
from vsnbench.results.schema.tables import Trial


def recorded_models(engine: Engine) -> set[str]:
    """Return the names of all models with campaigns; codes for blinded arms.

    Raises:
        RecordError: the database cannot be read.
    """
    with record_errors(engine), reading(engine).begin() as connection:
        return set(connection.scalars(episodes_of_campaigns(MODEL_NAME).distinct()))


def recorded_goals(engine: Engine) -> set[str]:
    """Return the goals that have trials.

    Raises:
        RecordError: the database cannot be read.
    """
    with record_errors(engine), reading(engine).begin() as connection:
        return set(connection.scalars(select(Trial.goal).distinct()))
