"""Training of the small PIRLNav network that is shipped with vsnbench; not part of the installed package."""
