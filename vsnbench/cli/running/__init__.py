"""Commands that run trials."""
