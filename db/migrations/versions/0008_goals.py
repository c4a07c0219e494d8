"""Definitions of goals that are not categories: words, photographs and instructions with their targets.

Revision: 0008
After: 0007
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

JSON_VALUE = sa.JSON(none_as_null=True).with_variant(postgresql.JSONB(none_as_null=True), "postgresql")

def upgrade() -> None:
    op.create_table(
        "goal",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("content", JSON_VALUE, nullable=False),
        sa.Column("image", sa.LargeBinary(), nullable=True),
        sa.PrimaryKeyConstraint("id", name="pk_goal"),
        sa.UniqueConstraint("sha256", name="uq_goal_sha256"),
    )
    # Both databases add such a column in place; recorded trials are of categories, which have no definition.
    op.execute("ALTER TABLE trial ADD COLUMN goal_id INTEGER CONSTRAINT fk_trial_goal_id_goal REFERENCES goal (id)")
