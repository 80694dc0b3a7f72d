"""Many twins: sweeps, tuning, identification."""
