"""Executors of trials: worker processes on this machine and on a Ray cluster."""
