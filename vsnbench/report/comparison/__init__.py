"""Comparisons of models: pairing, effects, ranking, verdicts."""
