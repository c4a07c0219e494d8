"""One episode: observe, decide, guard, move, record."""
