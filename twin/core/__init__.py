"""The twin itself: one virtual clock for controller, line, wiring and plant, and all that can be read and done."""
