"""Bundles: results in one archive that another person can check."""
