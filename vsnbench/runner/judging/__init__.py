"""Turns an operator's answer into a verdict: terminal, page, `vsnbench judge` and studies share it."""
