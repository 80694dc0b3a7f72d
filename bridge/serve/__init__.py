"""A twin behind ports, in real time."""
