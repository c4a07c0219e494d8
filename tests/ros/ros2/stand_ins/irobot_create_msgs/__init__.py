"""Stands in for a package that comes with a robot's distribution and in no wheel."""
