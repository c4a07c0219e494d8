"""Sites that look like a scan of the real place: import, drawing and comparison with the survey."""
