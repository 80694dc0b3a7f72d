"""Job files: read, played, judged."""
