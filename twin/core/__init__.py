"""The twin itself: one virtual clock for controller, line, wiring and plant, and what is seen of it."""
