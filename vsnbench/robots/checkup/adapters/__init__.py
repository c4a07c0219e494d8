"""Checks of motion adapters."""
