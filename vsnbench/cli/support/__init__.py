"""Options, output and errors shared by all commands."""
