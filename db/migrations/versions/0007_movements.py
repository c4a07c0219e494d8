"""Movements with parameters: waypoints, velocities and others, and the parts of chunks.

Steps recorded before this revision are discrete actions.

Revision: 0007
After: 0006
"""

from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Both databases add such a column in place, without rebuilding the table.
    json = "JSONB" if op.get_bind().dialect.name == "postgresql" else "JSON"
    op.execute(f"ALTER TABLE step ADD COLUMN movement {json}")
