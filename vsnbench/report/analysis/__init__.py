"""Numbers of a report, computed from recorded episodes.

Functions that take an engine raise `RecordError` if the database cannot be used.
"""
