"""Package of the tests: some libraries install a top-level `tests` that would hide a plain folder."""
