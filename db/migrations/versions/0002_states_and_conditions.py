"""Episodes have states, robots say who they are, events say who did it, a campaign is a condition and a seed.

Campaigns of one condition and seed become one: where both had run a trial, the first result counts.

Revision: 0002
After: 0001
"""

import hashlib
import json
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.dialects import postgresql

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

JSON_VALUE = sa.JSON(none_as_null=True).with_variant(postgresql.JSONB(none_as_null=True), "postgresql")
MOMENT = sa.DateTime(timezone=True)
ACTIVE = sa.text("state IN ('claimed', 'placed', 'running')")
OUR_PROFILES = ("turtlebot2", "lola2")
"""The embedded profiles of this schema's time: `--robot` named one of them, or a file, for a robot on ROS 1."""


def upgrade() -> None:
    _robots()
    _models()
    _conditions()
    _states()
    _authors()
    _merge_campaigns()
    op.create_index(
        "uq_episode_active_trial_id",
        "episode",
        ["trial_id"],
        unique=True,
        sqlite_where=ACTIVE,
        postgresql_where=ACTIVE,
    )


def _robots() -> None:
    op.add_column("robot", sa.Column("kind", sa.Text(), nullable=True))
    database = op.get_bind()
    robot = sa.table(
        "robot", *(sa.column(name) for name in ("id", "backend", "kind", "simulated", "sha256"))
    ) 
    rows = database.execute(sa.text("SELECT id, backend, simulated, profile FROM robot ORDER BY id")).all()
    with op.batch_alter_table("robot") as table:
        table.drop_constraint("uq_robot_sha256_backend", type_="unique")
    known: dict[str, int] = {}
    for row in rows:
        kind = _kind(row.backend)
        content = _value(row.profile)
        profile = hashlib.sha256(
            json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":")).encode()
        ).hexdigest()
        told = json.dumps([profile, kind, bool(row.simulated), ""], separators=(",", ":"))
        sha256 = hashlib.sha256(told.encode()).hexdigest()
        if sha256 in known:
            database.execute(
                sa.text("UPDATE campaign SET robot_id = :first WHERE robot_id = :same"),
                {"first": known[sha256], "same": row.id},
            )
            database.execute(sa.text("DELETE FROM robot WHERE id = :same"), {"same": row.id})
            continue
        known[sha256] = row.id
        database.execute(sa.update(robot).where(robot.c.id == row.id).values(kind=kind, sha256=sha256))
    with op.batch_alter_table("robot") as table:
        table.alter_column("kind", existing_type=sa.Text(), nullable=False)
        table.drop_column("backend")
        table.create_unique_constraint("uq_robot_sha256", ["sha256"])


def _kind(backend: str) -> str:
    """Return what carried out the actions, from what was typed."""
    if backend in ("simulated", "imported"):
        return backend
    ros = backend in ("ros", *OUR_PROFILES) or backend.endswith((".yaml", ".yml"))
    return "ros1" if ros else backend


def _models() -> None:
    for name in ("files", "code"):
        op.add_column("model", sa.Column(name, JSON_VALUE, nullable=True))
    op.execute("UPDATE model SET files = '{}', code = '{}'")
    with op.batch_alter_table("model") as table:
        table.alter_column("files", existing_type=JSON_VALUE, nullable=False)
        table.alter_column("code", existing_type=JSON_VALUE, nullable=False)


def _conditions() -> None:
    """Noise was one of the conditions of a simulated robot; of a real one the column held its filters."""
    with op.batch_alter_table("campaign") as table:
        table.alter_column("noise", new_column_name="conditions", existing_type=JSON_VALUE, existing_nullable=False)
        for name in ("goals", "starts", "repetitions", "shuffled"):  # the trials say all of it
            table.drop_column(name)
    with op.batch_alter_table("trial") as table:
        table.alter_column("place", new_column_name="rank", existing_type=sa.Integer(), existing_nullable=False)
    database = op.get_bind()
    campaign = sa.table("campaign", sa.column("id"), sa.column("conditions", JSON_VALUE))
    rows = database.execute(
        sa.text(
            "SELECT campaign.id, conditions FROM campaign JOIN robot ON robot.id = robot_id WHERE kind = 'simulated'"
        )
    ).all()
    for row in rows:
        if noise := _value(row.conditions):
            database.execute(
                sa.update(campaign).where(campaign.c.id == row.id).values(conditions={"noise": noise})
            )


def _states() -> None:
    op.drop_index("ix_episode_end_reason", "episode")
    op.add_column("episode", sa.Column("state", sa.Text(), nullable=True))
    op.add_column("episode", sa.Column("lease_until", MOMENT, nullable=True))
    op.add_column("episode", sa.Column("start_source", sa.Text(), nullable=True))
    op.add_column("verdict", sa.Column("proposed", sa.Boolean(), nullable=True))
    op.add_column("verdict", sa.Column("note", sa.Text(), nullable=True))
    for table_name in ("episode", "verdict"):
        op.add_column(table_name, sa.Column("goal_in_sight", sa.Boolean(), nullable=True))
    op.execute(sa.text("UPDATE verdict SET proposed = :no, note = ''").bindparams(sa.bindparam("no", False, sa.Boolean())))
    # A verdict stood as soon as it was given, a real robot's too: what was counted then stays counted.
    op.execute(
        """
        UPDATE episode SET
            state = CASE
                WHEN end_reason IS NULL THEN 'running'
                WHEN EXISTS (SELECT 1 FROM verdict WHERE episode_id = episode.id) THEN CASE
                    WHEN (
                        SELECT success FROM verdict WHERE episode_id = episode.id ORDER BY id DESC LIMIT 1
                    ) IS NULL THEN 'void' ELSE 'judged' END
                WHEN end_reason IN ('stop', 'step_limit', 'collision') THEN 'awaiting'
                ELSE 'void' END,
            start_source = CASE WHEN start_x_m IS NULL THEN NULL ELSE (
                SELECT world_source FROM step WHERE episode_id = episode.id ORDER BY number LIMIT 1) END
        """
    )
    with op.batch_alter_table("verdict") as table:
        table.alter_column("proposed", existing_type=sa.Boolean(), nullable=False)
        table.alter_column("note", existing_type=sa.Text(), nullable=False)
    op.drop_index("ix_verdict_episode_id_id", "verdict")
    op.create_index("ix_verdict_episode_id_proposed_id", "verdict", ["episode_id", "proposed", "id"])
    with op.batch_alter_table("episode", table_kwargs={"sqlite_autoincrement": True}) as table:
        table.alter_column("state", existing_type=sa.Text(), nullable=False)
        table.create_check_constraint(
            "ck_episode_state_fits_the_end",
            "state IN ('claimed', 'placed', 'running', 'awaiting', 'judged', 'void') "
            "AND (state IN ('claimed', 'placed', 'running')) = (end_reason IS NULL)",
        )


def _authors() -> None:
    """Who intervened stood at the end of the words, as ", by NAME": only the name of an operator is taken for one."""
    op.add_column("event", sa.Column("author", sa.Text(), nullable=True))
    op.execute("UPDATE event SET author = ''")
    with op.batch_alter_table("event") as table:
        table.alter_column("author", existing_type=sa.Text(), nullable=False)
    database = op.get_bind()
    operators = {row.operator for row in database.execute(sa.text("SELECT DISTINCT operator FROM process"))} - {""}
    for row in database.execute(sa.text("SELECT id, text FROM event WHERE kind = 'intervention'")).all():
        author = max((name for name in operators if row.text.endswith(f", by {name}")), key=len, default="")
        if author:
            database.execute(
                sa.text("UPDATE event SET author = :author, text = :words WHERE id = :id"),
                {"author": author, "words": row.text[: -len(f", by {author}")], "id": row.id},
            )


def _merge_campaigns() -> None:
    database = op.get_bind()
    rows = database.execute(
        sa.text(
            "SELECT campaign.id, campaign.name, campaign.created_at, site.sha256 AS site, robot.sha256 AS robot, "
            "model.sha256 AS model, protocol_sha256, conditions, seed FROM campaign JOIN site ON site.id = site_id "
            "JOIN robot ON robot.id = robot_id JOIN model ON model.id = model_id ORDER BY campaign.id"
        )
    ).all()
    # The old keys are out of the way first: a new one might be equal to one of them only by malice, but still.
    first_of: dict[str, int] = {}
    for row in rows:
        key = _sha256([row.site, row.robot, row.model, row.protocol_sha256, _value(row.conditions), row.seed])
        if key in first_of:
            _merge(database, row, first_of[key])
            continue
        first_of[key] = row.id
        database.execute(sa.text("UPDATE campaign SET key = :key WHERE id = :id"), {"key": key, "id": row.id})
    _end_all_but_the_last(database)


def _merge(database: sa.Connection, same: Any, first: int) -> None:
    """Take a campaign's trials into the first one of its condition and seed, and its episodes with them."""
    known = {(row.goal, row.start, row.repetition): row.id for row in _trials(database, first)}
    rank = database.execute(sa.text("SELECT max(rank) FROM trial WHERE campaign_id = :id"), {"id": first}).scalar_one()
    for trial in _trials(database, same.id):
        cell = (trial.goal, trial.start, trial.repetition)
        if cell in known:
            moved = {"to": known[cell], "trial": trial.id}
            database.execute(sa.text("UPDATE episode SET trial_id = :to WHERE trial_id = :trial"), moved)
            database.execute(sa.text("DELETE FROM trial WHERE id = :trial"), {"trial": trial.id})
            continue
        rank += 1
        database.execute(
            sa.text("UPDATE trial SET campaign_id = :to, rank = :rank WHERE id = :trial"),
            {"to": first, "rank": rank, "trial": trial.id},
        )
    database.execute(
        sa.text("UPDATE event SET campaign_id = :to WHERE campaign_id = :same"), {"to": first, "same": same.id}
    )
    event = sa.table(
        "event",
        sa.column("campaign_id"),
        sa.column("created_at", MOMENT),
        sa.column("kind"),
        sa.column("author"),
        sa.column("text"),
    )
    words = f"campaign {same.id} ({same.name}, of {same.created_at}) had the same condition and seed: it is part of this one"
    said = {"kind": "merged", "author": "", "text": words}
    database.execute(sa.insert(event), {"campaign_id": first, "created_at": datetime.now(UTC), **said})
    database.execute(sa.text("DELETE FROM campaign WHERE id = :same"), {"same": same.id})


def _trials(database: sa.Connection, campaign_id: int) -> Iterable[Any]:
    return database.execute(
        sa.text("SELECT id, goal, start, repetition FROM trial WHERE campaign_id = :id ORDER BY rank"),
        {"id": campaign_id},
    ).all()


def _end_all_but_the_last(database: sa.Connection) -> None:
    """Two campaigns that became one may each have left the same trial running, by processes long dead."""
    database.execute(
        sa.text(
            "UPDATE episode SET state = 'void', end_reason = 'interrupted', ended_at = started_at, "
            "error = 'the process died' WHERE state = 'running' AND id NOT IN "
            "(SELECT max(id) FROM episode WHERE state = 'running' GROUP BY trial_id)"
        )
    )


def _value(stored: Any) -> Any:
    return json.loads(stored) if isinstance(stored, str) else stored


def _sha256(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
