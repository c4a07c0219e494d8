"""Adds sessions (an operator with a robot) and measured placements at the start of an episode.

Earlier episodes have neither a session nor a measurement.

Revision: 0004
After: 0003
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

JSON_VALUE = sa.JSON(none_as_null=True).with_variant(postgresql.JSONB(none_as_null=True), "postgresql")
MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "session",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("uuid", sa.Text(), nullable=False),
        sa.Column("process_id", sa.Integer(), nullable=False),
        sa.Column("robot_id", sa.Integer(), nullable=False),
        sa.Column("operator", sa.Text(), nullable=False),
        sa.Column("began_at", MOMENT, nullable=False),
        sa.Column("ended_at", MOMENT, nullable=True),
        sa.Column("words", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["process_id"], ["process.id"], name="fk_session_process_id_process"),
        sa.ForeignKeyConstraint(["robot_id"], ["robot.id"], name="fk_session_robot_id_robot"),
        sa.PrimaryKeyConstraint("id", name="pk_session"),
        sa.UniqueConstraint("uuid", name="uq_session_uuid"),
    )
    op.create_index("ix_session_process_id", "session", ["process_id"])
    # Both databases add such a column as it stands here: the table, with thousands of rows, need not be made anew.
    op.execute(
        "ALTER TABLE episode ADD COLUMN session_id INTEGER "
        "CONSTRAINT fk_episode_session_id_session REFERENCES session (id)"
    )
    op.create_index("ix_episode_session_id", "episode", ["session_id"])
    op.create_table(
        "placement",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("episode_id", sa.Integer(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("author", sa.Text(), nullable=False),
        sa.Column("method", sa.Text(), nullable=False),
        sa.Column("looks", sa.Integer(), nullable=False),
        sa.Column("x_m", sa.Double(), nullable=False),
        sa.Column("y_m", sa.Double(), nullable=False),
        sa.Column("heading_rad", sa.Double(), nullable=False),
        sa.Column("covariance", JSON_VALUE, nullable=False),
        sa.Column("ahead_m", sa.Double(), nullable=False),
        sa.Column("left_m", sa.Double(), nullable=False),
        sa.Column("turn_rad", sa.Double(), nullable=False),
        sa.Column("determined", sa.Boolean(), nullable=False),
        sa.Column("within_tolerance", sa.Boolean(), nullable=False),
        sa.Column("undetermined", JSON_VALUE, nullable=False),
        sa.Column("moved", JSON_VALUE, nullable=False),
        sa.Column("depth_scale", sa.Double(), nullable=False),
        sa.Column("words", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["episode_id"], ["episode.id"], name="fk_placement_episode_id_episode"),
        sa.PrimaryKeyConstraint("id", name="pk_placement"),
        sa.UniqueConstraint("episode_id", name="uq_placement_episode_id"),
    )
