"""Queries of recorded episodes."""
