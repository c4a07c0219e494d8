"""Where a robot stands on the map it is making: depth images against the walls already in it."""
