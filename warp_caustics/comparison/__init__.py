"""Error against run time and memory: every method and its settings on one scene, beside a converged reference."""

from __future__ import annotations

from warp_caustics.comparison.record import Comparison
from warp_caustics.comparison.run import compare

__all__ = ["Comparison", "compare"]
