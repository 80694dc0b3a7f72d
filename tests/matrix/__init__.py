"""Every tool with every controller, fault and plant: what becomes of it (docs/faults.md)."""
