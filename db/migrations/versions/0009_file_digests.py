"""Digests of the bytes of image files; NULL for steps recorded before this revision.

Revision: 0009
After: 0008
"""

from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Both databases add such a column in place, without rebuilding the table.
    for column in ("rgb_file_digest", "depth_file_digest"):
        op.execute(f"ALTER TABLE step ADD COLUMN {column} TEXT")
