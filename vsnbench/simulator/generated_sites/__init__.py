"""Generated sites: furnished flats of 50 to 100 m2 from a seed."""
