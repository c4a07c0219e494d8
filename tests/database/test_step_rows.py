"""A step's row: what it renews, and that nothing is written into an episode of somebody else."""

from datetime import timedelta

import pytest
from sqlalchemy import Engine, text

from tests.database.records_of_a_lab import begun, forward, plan
from vsnbench.database import step_rows
from vsnbench.database.journal import Journal
from vsnbench.database.queries import episode_steps
from vsnbench.errors import EpisodeClosedError


def test_a_steps_row_renews_a_lease_of_which_a_part_has_passed_and_is_refused_elsewhere_all_the_same(
    sqlite: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lease_until(engine: Engine) -> str:
        with engine.connect() as connection:
            return str(connection.execute(text("SELECT lease_until FROM episode")).scalar_one())

    with Journal.open(sqlite) as journal:
        episode = begun(journal, journal.find_or_create_campaign(plan()).trials[0])
        journal.append_step(episode.id, forward(1))
        renewed = lease_until(journal.engine)
        journal.append_step(episode.id, forward(2))
        assert lease_until(journal.engine) == renewed, "hardly any of it has passed"
        monkeypatch.setattr(step_rows, "RENEWED_AFTER", timedelta(0))
        journal.append_step(episode.id, forward(3))
        assert lease_until(journal.engine) > renewed
        monkeypatch.undo()
        with Journal.open(sqlite) as other, other.engine.begin() as connection:
            connection.execute(text("UPDATE episode SET process_id = process_id + 1"))
        with pytest.raises(EpisodeClosedError, match="step 4 was not recorded"):
            journal.append_step(episode.id, forward(4))
        assert len(episode_steps(journal.engine, episode.id)) == 3
