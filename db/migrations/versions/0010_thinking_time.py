"""Time that the model thought in an episode: the sum over its steps, which a report of many episodes would add up.

Revision: 0010
After: 0009
"""

from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Both databases add such a column in place, without rebuilding the table.
    number = "DOUBLE PRECISION" if op.get_bind().dialect.name == "postgresql" else "DOUBLE"
    op.execute(f"ALTER TABLE episode ADD COLUMN thinking_s {number}")
    op.execute(
        "UPDATE episode SET thinking_s = (SELECT CASE WHEN count(infer_s) = count(*) THEN sum(infer_s) END FROM step "
        "WHERE step.episode_id = episode.id) WHERE end_reason IS NOT NULL"
    )
