"""`python -m mjxgait`: the same as the command `mjxgait`."""

from mjxgait.cli import main

if __name__ == "__main__":
    main()
