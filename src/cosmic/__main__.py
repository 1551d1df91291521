"""``python -m cosmic``: the command line."""

import sys

from cosmic.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
