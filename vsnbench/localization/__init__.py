"""Localization: measures a robot's pose by matching depth images with the site's twin."""
