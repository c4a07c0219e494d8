"""Episodes in Rerun, live and from the record."""
