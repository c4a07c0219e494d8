"""Walls and lines of sight of a site."""
