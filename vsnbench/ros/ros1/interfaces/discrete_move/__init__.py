"""Package `discrete_move` for the tools of ROS, where that of upstream is not built."""
