"""Verifies results that another person recorded: hashes, images, verdicts, reports, studies and simulated episodes."""
