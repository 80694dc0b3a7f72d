"""BWO 900: a CNC that runs DIN 66025 programs on servo axes."""
