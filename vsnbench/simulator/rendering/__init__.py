"""Color, depth and label images of a scene."""
