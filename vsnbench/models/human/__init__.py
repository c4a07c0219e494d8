"""A person as a model: acts through a page that shows the robot's camera."""
