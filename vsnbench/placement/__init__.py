"""Where a robot stands, measured: its depth images against what the site's twin says that it should see; pure."""
