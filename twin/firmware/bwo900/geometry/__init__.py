"""Lines, arcs and coordinates: blocks of a path, inserted corners, radius correction."""
