"""Commands for results that others can check: bundles and verification."""
