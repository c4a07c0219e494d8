"""Statistical inference with NumPy and SciPy, one method per module; independent of the record."""
