"""Robots, their profiles and their check-ups."""
