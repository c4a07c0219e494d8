"""The tests, as a package of their own: some libraries install a top-level `tests` that would hide a bare folder."""
