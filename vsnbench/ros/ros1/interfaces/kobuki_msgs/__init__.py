"""Package `kobuki_msgs` for the tools of ROS, where it is not installed."""
