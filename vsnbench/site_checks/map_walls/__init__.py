"""Walls found in an occupancy grid map."""
