"""Datasets in the format LeRobotDataset v3.0, for imitation learning."""
