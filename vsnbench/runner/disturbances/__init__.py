"""Disturbances of what a policy sees; the robot's own data stay as they are."""
