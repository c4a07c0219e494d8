"""Why the depth guard refused or ended an action: a column of its own, because `failure` is about the robot.

Revision: 0011
After: 0010
"""

from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Both databases add such a column in place, without rebuilding the table.
    op.execute("ALTER TABLE step ADD COLUMN refusal TEXT NOT NULL DEFAULT ''")
    op.execute("UPDATE step SET refusal = failure, failure = '' WHERE blocked AND failure <> ''")
    # An action that was refused before it began had its reason in an event alone; version 1.0.0 wrote the number of the
    # action before it.
    op.execute(
        "UPDATE step SET refusal = COALESCE((SELECT "
        "REPLACE(event.text, 'action ' || CAST(step.number AS TEXT) || ': ', '') "
        "FROM event WHERE event.episode_id = step.episode_id AND event.step_number = step.number "
        "AND event.kind = 'blocked' ORDER BY event.id LIMIT 1), '') "
        "WHERE blocked AND refusal = ''"
    )
