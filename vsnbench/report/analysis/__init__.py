"""Numbers of a report, computed from recorded episodes."""
