"""Programs as text, read block by block; stored, or fed while they are executed."""
