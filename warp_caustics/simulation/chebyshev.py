r"""Chebyshev's iteration for the implicit step: how many iterations, and their coefficients (Saad 2003, section 12.3).

The matrix is ``1 + dt^2/4 K``, ``K`` being the stiffness with its known eigenvalues in ``[0, w_max^2]``. A fixed count
of iterations is a fixed polynomial in ``K``. That is why it is preferred to conjugate gradients: there are no sums
over the grid, so that nothing is read back, the order of threads cannot matter, and a frame can be captured; and a
step stays a linear map that has the same modes as the water. Solving for the mean of a step's two heights, from its
right-hand side as the first guess, the map of a mode is ``[[2q - 1, 2q], [2q - 2, 2q - 1]]`` with
``q = (1 + r theta^2) / (1 + theta^2)``, ``theta = w dt / 2`` and ``|r|`` the residual's bound. Its determinant is 1
whatever ``q``, and it is stable for ``0 < q < 1``, which ``|r| theta^2 < 1`` assures: an unfinished solve changes a
mode's frequency by a share of ``r theta^2`` and gives or takes no energy.
"""

from __future__ import annotations

import functools
import math

SOLVER_TOLERANCE = 1e-9
"""Relative error of a mode's mean height in a step at most, of the stiffest mode."""

MOST_ITERATIONS = 2**15
"""Iterations of an implicit step at most: it is then some 2000 explicit steps long, and costs as much as 30 000."""

HALVINGS = 100
"""Bisections of the logarithm of a stiffness: past float64's resolution."""


def chebyshev_count(stiffness: float) -> int:
    """Iterations after which the error is below the tolerance; ``stiffness`` is ``(w_max dt / 2)^2``."""
    if stiffness == 0.0:
        return 1
    reduction = max(stiffness, 1.0) / SOLVER_TOLERANCE
    # The eigenvalues' centre, in units of their half width, is past 1 by this; 1 + past would lose it in stiff steps.
    past = 2.0 / stiffness
    return max(1, math.ceil(math.acosh(reduction) / math.log1p(past + math.sqrt(past * (past + 2.0)))))


@functools.cache
def stiffest_solved() -> float:
    """Stiffness that the iterations at most can solve."""
    # A stiffness takes about as many iterations as its square root, so that one of their fourth power takes too many.
    solved, beyond = 0.0, 4.0 * math.log(MOST_ITERATIONS)
    for _ in range(HALVINGS):
        middle = 0.5 * (solved + beyond)
        if chebyshev_count(math.exp(middle)) <= MOST_ITERATIONS:
            solved = middle
        else:
            beyond = middle
    return math.exp(solved)


def chebyshev_coefficients(stiffness: float, count: int) -> list[tuple[float, float]]:
    """Return (kept, gained) of each iteration: ``change = kept change + gained residual``."""
    middle, half = 1.0 + 0.5 * stiffness, 0.5 * stiffness
    coefficients = [(0.0, 1.0 / middle)]
    rho = half / middle
    for _ in range(count - 1):
        following = 1.0 / (2.0 * middle / half - rho)
        coefficients.append((following * rho, 2.0 * following / half))
        rho = following
    return coefficients
