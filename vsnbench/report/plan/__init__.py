"""Floor plans of sites for papers and as a background for trajectories."""
