"""Between a real host and a real controller."""
