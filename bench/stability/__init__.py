"""What each method makes of extremes: sweeps of one thing at a time, against float64 that shares no code with it."""

from __future__ import annotations

import sys
from pathlib import Path

TESTS = Path(__file__).parents[2] / "tests"
"""Where the float64 reference lives, which is imported as ``oracle``."""

if str(TESTS) not in sys.path:
    sys.path.insert(0, str(TESTS))
