"""The queryable record: tables, sessions and queries."""
