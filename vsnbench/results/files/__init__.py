"""Files of a results directory: images, paths, entries."""
