"""`python -m isel_twin`."""

from isel_twin.cli import main

if __name__ == "__main__":
    main()
