"""Poses measured where a robot stopped, beside those measured at its mark, with the distances to the goal.

Revision: 0012
After: 0011
"""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None

NUMBERS = ("distance_m", "distance_low_m", "distance_high_m", "odometry_m", "odometry_low_m", "odometry_high_m")


def upgrade() -> None:
    with op.batch_alter_table("placement") as table:
        table.add_column(sa.Column("moment", sa.Text(), nullable=False, server_default="start"))
        for name in NUMBERS:
            table.add_column(sa.Column(name, sa.Double(), nullable=True))
        table.add_column(sa.Column("verdicts_differ", sa.Boolean(), nullable=True))
        table.drop_constraint("uq_placement_episode_id", type_="unique")
        table.create_unique_constraint("uq_placement_episode_id_moment", ["episode_id", "moment"])
