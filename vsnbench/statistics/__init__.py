"""Statistics of success rates and their comparison: numpy and scipy only, nothing of the record."""
