"""Atomic file writes, temporary directories and disk caches."""
