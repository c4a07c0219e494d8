"""Robots driven over ROS 1 or ROS 2."""
