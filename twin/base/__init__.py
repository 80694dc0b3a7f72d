"""What every room uses: units, axes, values with their place in a file, files."""
