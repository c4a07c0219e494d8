"""A study's hash-chained log, and the numbers of the claims that were given back.

Studies locked before this revision have no log. Gaps in the episode numbers of an existing SQLite record are entered as
claims given back, because that record cannot tell what caused them.

Revision: 0006
After: 0005
"""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "study_event",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("content", sa.Text(), nullable=False),
        sa.Column("previous", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name="fk_study_event_study_id_study"),
        sa.PrimaryKeyConstraint("id", name="pk_study_event"),
        sa.UniqueConstraint("study_id", "sha256", name="uq_study_event_study_id_sha256"),
    )
    # Both databases add such a column in place, without rebuilding the table.
    op.execute("ALTER TABLE study ADD COLUMN log_heads TEXT NOT NULL DEFAULT ''")
    op.create_table(
        "released_claim",
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("released_at", MOMENT, nullable=True),
        sa.PrimaryKeyConstraint("number", name="pk_released_claim"),
    )
    if op.get_bind().dialect.name == "sqlite":
        op.execute(
            "WITH RECURSIVE given(number) AS ("
            "SELECT seq FROM sqlite_sequence WHERE name = 'episode' AND seq > 0 "
            "UNION ALL SELECT number - 1 FROM given WHERE number > 1) "
            "INSERT INTO released_claim (number) SELECT number FROM given WHERE number NOT IN (SELECT id FROM episode)"
        )
