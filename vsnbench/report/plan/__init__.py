"""Floor plans of sites, as a person would put them in a paper; trajectories can be drawn over them."""
