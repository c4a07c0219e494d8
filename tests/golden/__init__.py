"""Outputs and simulated trials that a change of structure must leave as they are: `python -m tests.golden`."""
