"""Commands for recorded results."""
