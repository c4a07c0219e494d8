"""Episodes in Rerun, live and from the record. Rerun is optional: modules that import it are loaded on first use."""
