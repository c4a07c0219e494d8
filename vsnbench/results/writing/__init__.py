"""Writing of episodes, steps, verdicts and sessions."""
