"""Studies in the database."""
