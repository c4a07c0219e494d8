"""The results directory: image files, whole-file writes, hashes."""
