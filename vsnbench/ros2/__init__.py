"""Connection to robots over ROS 2."""
