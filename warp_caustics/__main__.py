"""`python -m warp_caustics`: the command line."""

import sys

from warp_caustics.cli import main

if __name__ == "__main__":
    sys.exit(main())
