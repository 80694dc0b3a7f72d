"""Operating a served twin: functions, control port, panel."""
