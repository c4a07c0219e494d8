"""Randomized twins: from a seed, a valid flat of 50 to 100 m2 with furniture of all goal categories."""
