"""`python -m host_clients` is `reconros client`."""

from __future__ import annotations

import sys

from reconros_zenoh.cli.main import main

if __name__ == "__main__":
    sys.argv.insert(1, "client")
    main()
