"""Base classes for what ROS 1 and ROS 2 do alike; imports neither."""
