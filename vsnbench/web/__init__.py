"""Web pages for the operator and for drawing a site."""
