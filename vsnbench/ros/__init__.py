"""Connection to robots over ROS: `common` is used by `ros1` and `ros2`, which do not know each other."""
