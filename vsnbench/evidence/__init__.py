"""Evidence for others: bundles of results, and checks of recorded results."""
