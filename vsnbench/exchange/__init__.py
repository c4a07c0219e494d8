"""Other tools' formats: episodes out of the record, and other tools' results into it."""
