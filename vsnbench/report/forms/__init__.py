"""The forms of a report: one module a format, each a function from sheets or results to text."""
