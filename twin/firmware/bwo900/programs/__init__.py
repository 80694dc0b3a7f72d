"""Programs: their text, read block by block; kept, or fed while they are carried out."""
