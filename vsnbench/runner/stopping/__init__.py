"""Requests to stop a session, from signals, keys and pages."""
