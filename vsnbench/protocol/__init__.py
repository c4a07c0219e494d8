"""The vocabulary and the rules of the protocol: pure values, no robot, no simulator, no database."""
