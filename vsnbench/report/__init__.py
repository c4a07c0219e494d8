"""Tables, statistics and figures from the database alone."""
