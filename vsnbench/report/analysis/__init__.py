"""Numbers of a report, read from the record. Functions with an engine raise `RecordError` if it cannot be used."""
