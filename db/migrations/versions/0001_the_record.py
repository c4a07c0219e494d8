"""The record: sites, robots, models, processes, campaigns, trials, episodes, steps, events, verdicts.

Revision: 0001
After: nothing
"""

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

JSON_VALUE = sa.JSON(none_as_null=True).with_variant(postgresql.JSONB(none_as_null=True), "postgresql")
MOMENT = sa.DateTime(timezone=True)


def upgrade() -> None:
    op.create_table(
        "model",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("weights_sha256", sa.Text(), nullable=False),
        sa.Column("weights_label", sa.Text(), nullable=False),
        sa.Column("settings", JSON_VALUE, nullable=False),
        sa.Column("goals", JSON_VALUE, nullable=True),
        sa.Column("sensors", JSON_VALUE, nullable=False),
        sa.Column("surveyed", sa.Boolean(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_model")),
        sa.UniqueConstraint("sha256", name=op.f("uq_model_sha256")),
    )
    op.create_table(
        "process",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("host", sa.Text(), nullable=False),
        sa.Column("pid", sa.Integer(), nullable=False),
        sa.Column("boot_id", sa.Text(), nullable=False),
        sa.Column("pid_namespace", sa.Text(), nullable=False),
        sa.Column("start_ticks", sa.BigInteger(), nullable=False),
        sa.Column("started_at", MOMENT, nullable=False),
        sa.Column("operator", sa.Text(), nullable=False),
        sa.Column("command", sa.Text(), nullable=False),
        sa.Column("vsnbench_version", sa.Text(), nullable=False),
        sa.Column("git_commit", sa.Text(), nullable=False),
        sa.Column("git_dirty", sa.Boolean(), nullable=False),
        sa.Column("packages", JSON_VALUE, nullable=False),
        sa.Column("platform", JSON_VALUE, nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_process")),
    )
    op.create_table(
        "robot",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("title", sa.Text(), nullable=False),
        sa.Column("backend", sa.Text(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("profile", JSON_VALUE, nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_robot")),
        sa.UniqueConstraint("sha256", "backend", name=op.f("uq_robot_sha256_backend")),
    )
    op.create_table(
        "site",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("title", sa.Text(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("content", JSON_VALUE, nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_site")),
        sa.UniqueConstraint("sha256", name=op.f("uq_site_sha256")),
    )
    op.create_table(
        "campaign",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("key", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("site_id", sa.Integer(), nullable=False),
        sa.Column("robot_id", sa.Integer(), nullable=False),
        sa.Column("model_id", sa.Integer(), nullable=False),
        sa.Column("process_id", sa.Integer(), nullable=False),
        sa.Column("protocol", JSON_VALUE, nullable=False),
        sa.Column("protocol_sha256", sa.Text(), nullable=False),
        sa.Column("noise", JSON_VALUE, nullable=False),
        sa.Column("goals", JSON_VALUE, nullable=False),
        sa.Column("starts", JSON_VALUE, nullable=False),
        sa.Column("repetitions", sa.Integer(), nullable=False),
        sa.Column("seed", sa.BigInteger(), nullable=False),
        sa.Column("shuffled", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(["model_id"], ["model.id"], name=op.f("fk_campaign_model_id_model")),
        sa.ForeignKeyConstraint(["process_id"], ["process.id"], name=op.f("fk_campaign_process_id_process")),
        sa.ForeignKeyConstraint(["robot_id"], ["robot.id"], name=op.f("fk_campaign_robot_id_robot")),
        sa.ForeignKeyConstraint(["site_id"], ["site.id"], name=op.f("fk_campaign_site_id_site")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_campaign")),
        sa.UniqueConstraint("key", name=op.f("uq_campaign_key")),
    )
    op.create_index(op.f("ix_campaign_model_id"), "campaign", ["model_id"])
    op.create_index(op.f("ix_campaign_robot_id"), "campaign", ["robot_id"])
    op.create_index(op.f("ix_campaign_site_id"), "campaign", ["site_id"])
    op.create_table(
        "trial",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.Column("goal", sa.Text(), nullable=False),
        sa.Column("start", sa.Integer(), nullable=False),
        sa.Column("repetition", sa.Integer(), nullable=False),
        sa.Column("place", sa.Integer(), nullable=False),
        sa.CheckConstraint("repetition >= 1", name=op.f("ck_trial_repetition_from_one")),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name=op.f("fk_trial_campaign_id_campaign")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_trial")),
        sa.UniqueConstraint(
            "campaign_id", "goal", "start", "repetition", name=op.f("uq_trial_campaign_id_goal_start_repetition")
        ),
    )
    op.create_table(
        "episode",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("uuid", sa.Text(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("process_id", sa.Integer(), nullable=False),
        sa.Column("origin", sa.Text(), nullable=False),
        sa.Column("seed", sa.BigInteger(), nullable=False),
        sa.Column("started_at", MOMENT, nullable=False),
        sa.Column("ended_at", MOMENT, nullable=True),
        sa.Column("end_reason", sa.Text(), nullable=True),
        sa.Column("error", sa.Text(), nullable=False),
        sa.Column("actions", sa.Integer(), nullable=False),
        sa.Column("path_length_m", sa.Double(), nullable=True),
        sa.Column("geodesic_start_m", sa.Double(), nullable=True),
        sa.Column("geodesic_end_m", sa.Double(), nullable=True),
        sa.Column("duration_s", sa.Double(), nullable=True),
        sa.Column("wall_duration_s", sa.Double(), nullable=True),
        sa.Column("distance_to_goal_m", sa.Double(), nullable=True),
        sa.Column("distance_source", sa.Text(), nullable=True),
        sa.Column("goal_instance", sa.Text(), nullable=True),
        sa.Column("start_x_m", sa.Double(), nullable=True),
        sa.Column("start_y_m", sa.Double(), nullable=True),
        sa.Column("start_heading_rad", sa.Double(), nullable=True),
        sa.Column("final_x_m", sa.Double(), nullable=True),
        sa.Column("final_y_m", sa.Double(), nullable=True),
        sa.Column("final_heading_rad", sa.Double(), nullable=True),
        sa.Column("final_source", sa.Text(), nullable=True),
        sa.Column("images_directory", sa.Text(), nullable=False),
        sa.CheckConstraint("(end_reason IS NULL) = (ended_at IS NULL)", name=op.f("ck_episode_ends_with_a_reason")),
        sa.ForeignKeyConstraint(["process_id"], ["process.id"], name=op.f("fk_episode_process_id_process")),
        sa.ForeignKeyConstraint(["trial_id"], ["trial.id"], name=op.f("fk_episode_trial_id_trial")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_episode")),
        sa.UniqueConstraint("uuid", name=op.f("uq_episode_uuid")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_episode_end_reason"), "episode", ["end_reason"])
    op.create_index(op.f("ix_episode_process_id"), "episode", ["process_id"])
    op.create_index(op.f("ix_episode_trial_id"), "episode", ["trial_id"])
    op.create_table(
        "event",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=True),
        sa.Column("episode_id", sa.Integer(), nullable=True),
        sa.Column("step_number", sa.Integer(), nullable=True),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name=op.f("fk_event_campaign_id_campaign")),
        sa.ForeignKeyConstraint(["episode_id"], ["episode.id"], name=op.f("fk_event_episode_id_episode")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_event")),
    )
    op.create_index(op.f("ix_event_campaign_id"), "event", ["campaign_id"])
    op.create_index(op.f("ix_event_episode_id"), "event", ["episode_id"])
    op.create_table(
        "step",
        sa.Column("episode_id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("number", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("raw_action", sa.Text(), nullable=False),
        sa.Column("action", sa.Text(), nullable=False),
        sa.Column("blocked", sa.Boolean(), nullable=False),
        sa.Column("completed", sa.Boolean(), nullable=False),
        sa.Column("failure", sa.Text(), nullable=False),
        sa.Column("recorded_at", MOMENT, nullable=False),
        sa.Column("stamp_s", sa.Double(), nullable=True),
        sa.Column("observed_x_m", sa.Double(), nullable=True),
        sa.Column("observed_y_m", sa.Double(), nullable=True),
        sa.Column("observed_heading_rad", sa.Double(), nullable=True),
        sa.Column("after_x_m", sa.Double(), nullable=True),
        sa.Column("after_y_m", sa.Double(), nullable=True),
        sa.Column("after_heading_rad", sa.Double(), nullable=True),
        sa.Column("world_x_m", sa.Double(), nullable=True),
        sa.Column("world_y_m", sa.Double(), nullable=True),
        sa.Column("world_heading_rad", sa.Double(), nullable=True),
        sa.Column("world_source", sa.Text(), nullable=True),
        sa.Column("displacement_m", sa.Double(), nullable=True),
        sa.Column("turn_rad", sa.Double(), nullable=True),
        sa.Column("duration_s", sa.Double(), nullable=True),
        sa.Column("corrections", sa.Integer(), nullable=False),
        sa.Column("collision_source", sa.Text(), nullable=True),
        sa.Column("collision_touched", sa.Text(), nullable=True),
        sa.Column("rgb_sha256", sa.Text(), nullable=True),
        sa.Column("depth_sha256", sa.Text(), nullable=True),
        sa.Column("sense_s", sa.Double(), nullable=True),
        sa.Column("infer_s", sa.Double(), nullable=True),
        sa.Column("move_s", sa.Double(), nullable=True),
        sa.Column("probabilities", JSON_VALUE, nullable=True),
        sa.Column("details", JSON_VALUE, nullable=True),
        sa.CheckConstraint("number >= 1", name=op.f("ck_step_number_from_one")),
        sa.ForeignKeyConstraint(["episode_id"], ["episode.id"], name=op.f("fk_step_episode_id_episode")),
        sa.PrimaryKeyConstraint("episode_id", "number", name=op.f("pk_step")),
        sqlite_with_rowid=False,
    )
    op.create_index("ix_step_actions", "step", ["episode_id", "raw_action", "action", "blocked"])
    op.create_table(
        "verdict",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("episode_id", sa.Integer(), nullable=False),
        sa.Column("created_at", MOMENT, nullable=False),
        sa.Column("success", sa.Boolean(), nullable=True),
        sa.Column("end_reason", sa.Text(), nullable=False),
        sa.Column("distance_m", sa.Double(), nullable=True),
        sa.Column("distance_source", sa.Text(), nullable=True),
        sa.Column("goal_instance", sa.Text(), nullable=True),
        sa.Column("author", sa.Text(), nullable=False),
        sa.Column("source", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["episode_id"], ["episode.id"], name=op.f("fk_verdict_episode_id_episode")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_verdict")),
    )
    op.create_index(op.f("ix_verdict_episode_id_id"), "verdict", ["episode_id", "id"])
