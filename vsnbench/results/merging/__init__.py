"""Merging of results directories."""
