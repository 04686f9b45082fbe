"""`python -m camkit` is `camkit`."""

from camkit.cli import main

if __name__ == "__main__":
    main()
