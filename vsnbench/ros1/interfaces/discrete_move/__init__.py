"""`discrete_move` for the tools of ROS, where upstream's package is not built."""
