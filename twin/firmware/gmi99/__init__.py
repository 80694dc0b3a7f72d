"""The GMI99 interpolation card."""
