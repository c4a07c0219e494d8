"""Robots that another program moves: the client of docs/motion-adapter.md."""
