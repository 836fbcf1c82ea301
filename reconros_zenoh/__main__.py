"""`python -m reconros_zenoh` is the command `reconros`."""

from reconros_zenoh.cli.main import main

if __name__ == "__main__":
    main()
