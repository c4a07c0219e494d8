"""Policies and how they are found."""
