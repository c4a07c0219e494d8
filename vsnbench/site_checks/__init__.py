"""Checks of a surveyed site."""
