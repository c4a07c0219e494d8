"""Videos of recorded episodes: camera, floor plan, actions and verdict."""
