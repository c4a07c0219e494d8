"""Whether a model fits a robot and a task: its camera, its goals, its decisions."""
