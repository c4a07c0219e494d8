"""Stands in for a package that comes with a distribution of ROS 2 and in no wheel."""
