"""Connection to robots over ROS 1."""
