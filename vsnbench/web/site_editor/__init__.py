"""The site editor."""
