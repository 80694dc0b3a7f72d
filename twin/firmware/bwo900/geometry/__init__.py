"""Lines, arcs and coordinates: what blocks are to the path, corners that are put in, radius correction."""
