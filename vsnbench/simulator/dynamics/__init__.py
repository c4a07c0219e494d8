"""Physics of the simulated base, its odometry and noise."""
