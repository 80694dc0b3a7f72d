"""`python -m isel_twin.cli`."""

from __future__ import annotations

from isel_twin.cli import main

if __name__ == "__main__":
    main()
