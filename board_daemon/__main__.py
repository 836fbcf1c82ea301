"""`python -m board_daemon` is `reconros board`."""

from __future__ import annotations

import sys

from reconros_zenoh.cli.main import main

if __name__ == "__main__":
    sys.argv.insert(1, "board")
    main()
