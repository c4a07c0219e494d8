"""Stacks that drive themselves: their file, how a trial is announced to them, and how they say that they arrived."""
