"""Odometry of a base: checks, TF, noise at rest."""
