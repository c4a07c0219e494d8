"""What is wrong with a surveyed site, and how to mend it."""
