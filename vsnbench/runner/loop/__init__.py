"""The trial loop: sources of trials, executors, and what follows an episode."""
