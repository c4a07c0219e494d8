"""An image's hash says what it was made with: until now SHA-256, from now on BLAKE3.

Revision: 0005
After: 0004
"""

from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # Both databases rename a column as it stands here: the table, with millions of rows, need not be made anew.
    for image in ("rgb", "depth"):
        op.execute(f"ALTER TABLE step RENAME COLUMN {image}_sha256 TO {image}_digest")
    # NULL stays NULL: the step has no such image.
    op.execute(
        "UPDATE step SET rgb_digest = 'sha256:' || rgb_digest, depth_digest = 'sha256:' || depth_digest "
        "WHERE rgb_digest IS NOT NULL OR depth_digest IS NOT NULL"
    )
