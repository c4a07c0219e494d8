"""VLV, the paper's modular model: a learned value, a detector, a map, a planner and a graph of places."""
