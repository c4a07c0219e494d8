"""A results directory: its database and its files."""
