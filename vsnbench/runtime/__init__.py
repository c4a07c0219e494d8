"""Processes, signals, threads and the Python environment."""
