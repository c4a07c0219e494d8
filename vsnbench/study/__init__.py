"""The plan of an experiment: its file, its lock, its schedule and codes, and when it is decided."""
