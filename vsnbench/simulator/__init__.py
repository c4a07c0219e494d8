"""Simulator: turns a site file into a scene with physics, a camera and odometry."""
