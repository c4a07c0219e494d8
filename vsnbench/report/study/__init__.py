"""Report of a study: plan, conduct, deviations, primary analysis and exploratory tables."""
