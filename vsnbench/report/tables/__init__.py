"""Tables of a report: rows and columns, without a file format."""
