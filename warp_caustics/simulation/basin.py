"""The rectangle of simulated water: its cells, its step, what stands in it; and what of it is refused."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.fft import LONGEST, SHORTEST
from ..water import GRAVITY
from .body import WaterBody
from .chebyshev import MOST_ITERATIONS, chebyshev_count, stiffest_solved
from .drops import WIDEST_DROP, check_drops, check_open

if TYPE_CHECKING:
    from ..scene import Scene, Simulation

LEAST_CELLS = 4
"""Cells along a side at least: fourth-order differences, mirrored at a wall, look two cells around."""

MOST_CELLS = 2**26
"""Cells at most, 8192 x 8192: more would be gigabytes of state."""

SAFE_SHARE = 0.9
"""Explicit step by default, as a share of the longest that is stable."""

WHOLE = 1e-9
"""Share of a cell by which a side may miss a whole number of them and still count as whole: rounding of decimals."""

MOST_WORK = 2**45
"""Cells in the launches up to a time at most: a core takes 2 ns for each, and so most of a day."""

LAUNCH_WORK = 2**12
"""Cells that take as long as a launch by itself."""

SHOWN = 1e-5
"""Share by which a longest value is lowered before it is shown in six digits, so that what is shown will pass."""


@dataclass(frozen=True, eq=False)
class Basin(WaterBody):
    """Simulated water, resolved: lengths in metres, times in seconds, positions in the world.

    Attributes
    ----------
    settings : Simulation
        As the scene gives them.
    step : float
        Of time; 0 where no steps are taken.
    solid : ndarray or None
        uint8 ``[rows, columns]``, 1 where an obstacle stands; None without obstacles.
    """

    settings: Simulation
    step: float = 0.0
    solid: np.ndarray | None = field(default=None, repr=False)

    @property
    def periodic(self) -> bool:
        """True where the water repeats; else it ends at walls."""
        return self.settings.border == "periodic"

    @property
    def spectral(self) -> bool:
        """True where modes are propagated; else cells are."""
        return self.settings.kind == "spectral"

    @property
    def explicit(self) -> bool:
        """True where cells are stepped by leapfrog."""
        return self.settings.kind == "grid" and self.settings.integrator == "explicit"

    @property
    def summary(self) -> str:
        """What is simulated, in words."""
        return f"{self.settings.kind}, {self.settings.border}"

    @property
    def fineness(self) -> str:
        """Path in the scene of the key that says how fine its cells are."""
        return f"water.simulation.{'resolution' if self.settings.cell is None else 'cell'}"

    @property
    def max_slope(self) -> float:
        """Steepest slope that is planned for, as it is declared."""
        return self.settings.max_slope

    @property
    def max_height(self) -> float:
        """Largest displacement that is planned for [m], as it is declared."""
        return self.settings.height_bound

    @property
    def tension(self) -> float:
        """Surface tension by density [m^3/s^2]."""
        return self.settings.surface_tension / self.settings.density

    @property
    def stiffest(self) -> float:
        """Bound of the square of the grid's angular frequencies [1/s^2]: Gershgorin's, for the roughest mode."""
        laplacian = sum(4.0 / side**2 for side in self.cell)
        return GRAVITY * self.depth * laplacian + self.tension * self.depth * laplacian**2

    @property
    def step_launches(self) -> int:
        """Launches of a step, 0 where no steps are taken."""
        if self.spectral:
            return 0
        return 2 if self.explicit else 2 + 2 * implicit_iterations(self)

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """World coordinates x ``[columns]`` and y ``[rows]`` of the middles of the cells [m]."""
        x = self.origin[0] + (np.arange(self.columns) + 0.5) * self.cell[0]
        y = self.origin[1] + (np.arange(self.rows) + 0.5) * self.cell[1]
        return x, y

    def away(self, position: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Way from a point, or its nearest image, to the middles of the cells: x ``[1, columns]``, y ``[rows, 1]``."""
        x, y = self.centres()
        along, across = x[None, :] - position[0], y[:, None] - position[1]
        if self.periodic:
            along -= self.size[0] * np.round(along / self.size[0])
            across -= self.size[1] * np.round(across / self.size[1])
        return along, across

    def steps_to(self, time: float, where: str = "time") -> int:
        """Whole steps nearest to a time, which is told as ``where`` if it is refused.

        Raises
        ------
        InputError
            If the time is before the first, or too many steps away.
        """
        if time < 0.0:
            raise InputError(f'{where}: water.simulation of kind "grid" runs from 0 s, got {time:g} s')
        most = MOST_WORK / (self.step_launches * (self.rows * self.columns + LAUNCH_WORK))
        if time / self.step > most:
            raise InputError(
                f"{where}: {time:g} s are {time / self.step:.3g} steps of {self.step:g} s of water.simulation, which "
                f"on {self.columns} x {self.rows} cells would take about a day or longer; expected "
                f"{(1.0 - SHOWN) * most * self.step:.6g} s at most, or a longer water.simulation.step, or larger cells"
            )
        return round(time / self.step)


def make_basin(scene: Scene, rest_depth: float, low: np.ndarray, high: np.ndarray) -> Basin:
    """Resolve the water's simulation.

    Parameters
    ----------
    scene : Scene
        Whose water is simulated.
    rest_depth : float
        Its depth at rest over the map, where the simulation gives none [m].
    low, high : ndarray
        Corners of the water that can light the map, which is simulated where no rectangle is given, ``[2]`` each [m].

    Raises
    ------
    InputError
        If its cells are too few, too many, too long, or no powers of two where they must be; if a step is unstable or
        takes too many iterations; if a drop is not resolved, beside the water, in an obstacle, or falls too late; or if
        an obstacle covers no cell, or all together cover all of them.
    """
    settings = scene.water.simulation
    assert settings is not None
    if settings.origin is not None and settings.size is not None:
        origin, size = settings.origin, settings.size
    else:
        origin, size = (float(low[0]), float(low[1])), (float(high[0] - low[0]), float(high[1] - low[1]))
    columns, rows = _cells(settings, size)
    plain = Basin(origin, size, rows, columns, settings.depth or rest_depth, settings)
    _check_shape(plain)
    check_drops(plain)
    if plain.spectral:
        return plain
    basin = replace(plain, step=_step(plain), solid=_solid(plain))
    for number, drop in enumerate(settings.drops):
        basin.steps_to(drop.time, f"water.simulation.drops[{number}].time")
        check_open(basin, number)
    return basin


def implicit_iterations(basin: Basin) -> int:
    """Chebyshev iterations of an implicit step."""
    drag = 0.5 * basin.settings.damping * basin.step
    return chebyshev_count(0.25 * basin.step**2 / (1.0 + drag) * basin.stiffest)


def _cells(settings: Simulation, size: tuple[float, float]) -> tuple[int, int]:
    """Columns and rows."""
    spectral, where = settings.kind == "spectral", "water.simulation.resolution"
    if settings.cell is not None:
        where = "water.simulation.cell"
        along = np.maximum(np.ceil(np.divide(size, settings.cell) * (1.0 - WHOLE)), LEAST_CELLS)
        if spectral:
            along = np.exp2(np.ceil(np.log2(along)))
    else:
        along = np.asarray(settings.resolution, dtype=np.float64)
    shown = f"{along[0]:.6g} x {along[1]:.6g}"
    most = LONGEST // (1 if settings.border == "periodic" else 2)
    if spectral and (along.max() > most or along.min() < max(SHORTEST, LEAST_CELLS) or (np.log2(along) % 1.0).any()):
        raise InputError(
            f"{where}: expected powers of two from {LEAST_CELLS} to {most} along each side of {settings.border} "
            f"spectral water, got {shown}"
        )
    if along.min() < LEAST_CELLS or along.prod() > MOST_CELLS:
        raise InputError(f"{where}: expected {LEAST_CELLS} cells a side to {MOST_CELLS:,} in all, got {shown}")
    return int(along[0]), int(along[1])


def _step(basin: Basin) -> float:
    """Step of time: the one given, if it is stable, or the default."""
    settings = basin.settings
    longest = 2.0 / float(np.sqrt(basin.stiffest))
    if not basin.explicit:
        return _implicit_step(basin)
    if settings.step is not None and settings.step >= longest:
        raise InputError(
            f"water.simulation.step: expected less than {longest:.6g} s, beyond which the explicit integrator is "
            f"unstable for cells of {basin.cell[0]:g} x {basin.cell[1]:g} m and {basin.depth:g} m of water, "
            f'got {settings.step:g} s; use integrator = "implicit" for longer steps'
        )
    return settings.step or SAFE_SHARE * longest


def _implicit_step(basin: Basin) -> float:
    """Step of time: the one given, if it can be solved, or the default."""
    given = basin.settings.step
    step = given or min(basin.cell) / float(np.sqrt(GRAVITY * basin.depth))
    count = implicit_iterations(replace(basin, step=step))
    if count <= MOST_ITERATIONS:
        return step
    # Of step^2 / 4 / (1 + damping step / 2) = square.
    square = stiffest_solved() / basin.stiffest
    dragged = square * basin.settings.damping
    longest = (1.0 - SHOWN) * float(dragged + np.sqrt(dragged**2 + 4.0 * square))
    if given is None:
        return longest
    raise InputError(
        f"water.simulation.step: {given:g} s take {count:.3g} iterations a step for cells of {basin.cell[0]:g} x "
        f"{basin.cell[1]:g} m and {basin.depth:g} m of water, and {MOST_ITERATIONS:,} are what is gone through; "
        f"expected {longest:.6g} s at most, or larger cells"
    )


def _check_shape(basin: Basin) -> None:
    """Refuse cells so much longer than the water is wide that it could hold no drop."""
    if max(basin.cell) > WIDEST_DROP * min(basin.size):
        key = basin.fineness if basin.settings.size is None else "water.simulation.size"
        raise InputError(
            f"{key}: expected sides that are cut into cells of about one length, got cells of "
            f"{basin.cell[0]:g} x {basin.cell[1]:g} m in {basin.size[0]:g} x {basin.size[1]:g} m of water"
        )


def _solid(basin: Basin) -> np.ndarray | None:
    """Cells whose middle lies in an obstacle."""
    if not basin.settings.obstacles:
        return None
    solid = np.zeros((basin.rows, basin.columns), dtype=np.uint8)
    for number, obstacle in enumerate(basin.settings.obstacles):
        away = basin.away(obstacle.position)
        if obstacle.radius is not None:
            inside = np.hypot(*away) <= obstacle.radius
        else:
            assert obstacle.size is not None
            half = 0.5 * np.asarray(obstacle.size)
            inside = (np.abs(away[0]) <= half[0]) & (np.abs(away[1]) <= half[1])
        if not inside.any():
            raise InputError(
                f"water.simulation.obstacles[{number}]: it covers the middle of no cell; expected one that stands in "
                f"the water, {basin.extent}, and is wider than a cell, {basin.cell[0]:g} x {basin.cell[1]:g} m"
            )
        solid[inside] = 1
    if solid.all():
        raise InputError("water.simulation.obstacles: expected some open water, and they cover all of it")
    return solid
