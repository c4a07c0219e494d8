"""`kobuki_msgs` for the tools of ROS, where the package is not installed."""
