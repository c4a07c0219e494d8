"""The page of a person who drives the robot."""
