"""Scans of real places: reading, alignment, the site that they propose, and comparison with the survey."""
