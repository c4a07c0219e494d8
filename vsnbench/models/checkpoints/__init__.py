"""Model weights: finding, hashing and loading them safely."""
