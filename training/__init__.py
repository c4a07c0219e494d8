"""Trains the small PIRLNav network that can ship with vsnbench; not part of the installed package."""
