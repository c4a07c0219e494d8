"""Baseline models that need no weights."""
