"""Studies: locked plans over several campaigns, their schedules, and what was done to them.

Revision: 0003
After: 0002
"""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None

MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "study",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("uuid", sa.Text(), nullable=False),
        sa.Column("title", sa.Text(), nullable=False),
        sa.Column("content", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("locked_sha256", sa.Text(), nullable=False),
        sa.Column("schedule_sha256", sa.Text(), nullable=False),
        sa.Column("seed", sa.BigInteger(), nullable=False),
        sa.Column("blind", sa.Boolean(), nullable=False),
        sa.Column("locked_at", MOMENT, nullable=False),
        sa.Column("unblinded_at", MOMENT, nullable=True),
        sa.Column("process_id", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["process_id"], ["process.id"], name="fk_study_process_id_process"),
        sa.PrimaryKeyConstraint("id", name="pk_study"),
        sa.UniqueConstraint("uuid", name="uq_study_uuid"),
    )
    op.create_table(
        "study_arm",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("code", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name="fk_study_arm_study_id_study"),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_study_arm_campaign_id_campaign"),
        sa.PrimaryKeyConstraint("id", name="pk_study_arm"),
        sa.UniqueConstraint("study_id", "name", name="uq_study_arm_study_id_name"),
        sa.UniqueConstraint("study_id", "code", name="uq_study_arm_study_id_code"),
        sa.UniqueConstraint("campaign_id", name="uq_study_arm_campaign_id"),
    )
    op.create_table(
        "study_trial",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("rank", sa.Integer(), nullable=False),
        sa.Column("block", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name="fk_study_trial_study_id_study"),
        sa.ForeignKeyConstraint(["trial_id"], ["trial.id"], name="fk_study_trial_trial_id_trial"),
        sa.PrimaryKeyConstraint("id", name="pk_study_trial"),
        sa.UniqueConstraint("study_id", "rank", name="uq_study_trial_study_id_rank"),
        sa.UniqueConstraint("trial_id", name="uq_study_trial_trial_id"),
    )
    op.create_table(
        "study_entry",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("study_id", sa.Integer(), nullable=False),
        sa.Column("process_id", sa.Integer(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("author", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("results", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["study_id"], ["study.id"], name="fk_study_entry_study_id_study"),
        sa.ForeignKeyConstraint(["process_id"], ["process.id"], name="fk_study_entry_process_id_process"),
        sa.PrimaryKeyConstraint("id", name="pk_study_entry"),
    )
    op.create_index("ix_study_entry_study_id", "study_entry", ["study_id"])
