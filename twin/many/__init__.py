"""Many twins: sweeps, tuning, identification, learning."""
