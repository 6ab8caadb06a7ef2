"""The rectangle of simulated water: its cells, its step, what stands in it; and what of it is refused."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels.fft import LONGEST, SHORTEST
from ..water import GRAVITY

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

WIDEST_DROP = 8.0
"""Radius of a drop at most, in sides of the water: its images, which are added up, would lift the water as one."""

MOST_STEPS = 10**9
"""Steps to a time at most: they are counted exactly, and would take days."""


@dataclass(frozen=True, eq=False)
class Basin:
    """Simulated water, resolved: lengths in metres, times in seconds, positions in the world.

    Attributes
    ----------
    settings : Simulation
        As the scene gives them.
    origin, size : (float, float)
        The rectangle.
    rows, columns : int
        Its cells.
    depth : float
        Of the water at rest.
    step : float
        Of time; 0 where no steps are taken.
    solid : ndarray or None
        uint8 ``[rows, columns]``, 1 where an obstacle stands; None without obstacles.
    """

    settings: Simulation
    origin: tuple[float, float]
    size: tuple[float, float]
    rows: int
    columns: int
    depth: float
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
    def cell(self) -> tuple[float, float]:
        """Sides of a cell [m]."""
        return self.size[0] / self.columns, self.size[1] / self.rows

    @property
    def tension(self) -> float:
        """Surface tension by density [m^3/s^2]."""
        return self.settings.surface_tension / self.settings.density

    @property
    def stiffest(self) -> float:
        """Bound of the square of the grid's angular frequencies [1/s^2]: Gershgorin's, for the roughest mode."""
        laplacian = sum(4.0 / side**2 for side in self.cell)
        return GRAVITY * self.depth * laplacian + self.tension * self.depth * laplacian**2

    def steps_to(self, time: float) -> int:
        """Whole steps nearest to a time.

        Raises
        ------
        InputError
            If the time is before the first, or too many steps away.
        """
        if time < 0.0:
            raise InputError(f'time: water.simulation of kind "grid" runs from 0 s, got {time:g} s')
        if time / self.step > MOST_STEPS:
            raise InputError(
                f"time: {time:g} s are {time / self.step:.3g} steps of {self.step:g} s of water.simulation, and "
                f"{MOST_STEPS:,} are what can be gone through; expected an earlier time or a longer step"
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
        If its cells are too few, too many, or no powers of two where they must be; if a step is unstable; if a drop
        is not resolved or beside the water; or if obstacles leave none of it.
    """
    settings = scene.water.simulation
    assert settings is not None
    if settings.origin is not None and settings.size is not None:
        origin, size = settings.origin, settings.size
    else:
        origin, size = (float(low[0]), float(low[1])), (float(high[0] - low[0]), float(high[1] - low[1]))
    columns, rows = _cells(settings, size)
    plain = Basin(settings, origin, size, rows, columns, settings.depth or rest_depth)
    _check_drops(plain)
    if plain.spectral:
        return plain
    return Basin(settings, origin, size, rows, columns, plain.depth, _step(plain), _solid(plain))


def cell_centres(basin: Basin) -> tuple[np.ndarray, np.ndarray]:
    """World coordinates x ``[columns]`` and y ``[rows]`` of the middles of the cells [m]."""
    x = basin.origin[0] + (np.arange(basin.columns) + 0.5) * basin.cell[0]
    y = basin.origin[1] + (np.arange(basin.rows) + 0.5) * basin.cell[1]
    return x, y


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
        return settings.step or min(basin.cell) / float(np.sqrt(GRAVITY * basin.depth))
    if settings.step is not None and settings.step >= longest:
        raise InputError(
            f"water.simulation.step: expected less than {longest:.6g} s, beyond which the explicit integrator is "
            f"unstable for cells of {basin.cell[0]:g} x {basin.cell[1]:g} m and {basin.depth:g} m of water, "
            f'got {settings.step:g} s; use integrator = "implicit" for longer steps'
        )
    return settings.step or SAFE_SHARE * longest


def _check_drops(basin: Basin) -> None:
    """Refuse drops that the cells do not resolve, or that fall beside the water."""
    low, high = np.asarray(basin.origin), np.add(basin.origin, basin.size)
    for number, drop in enumerate(basin.settings.drops):
        where = f"water.simulation.drops[{number}]"
        least, most = max(basin.cell), WIDEST_DROP * min(basin.size)
        if not least <= drop.radius <= most:
            raise InputError(
                f"{where}.radius: expected {least:g} m, a cell's side, to {most:g} m, {WIDEST_DROP:g} times the "
                f"water's, got {drop.radius:g} m"
            )
        if not basin.periodic and not ((low <= drop.position) & (drop.position <= high)).all():
            raise InputError(
                f"{where}.position: expected a point of the water, x {low[0]:g} to {high[0]:g} m, "
                f"y {low[1]:g} to {high[1]:g} m, got {list(drop.position)}"
            )


def _solid(basin: Basin) -> np.ndarray | None:
    """Cells whose middle lies in an obstacle."""
    if not basin.settings.obstacles:
        return None
    x, y = cell_centres(basin)
    solid = np.zeros((basin.rows, basin.columns), dtype=np.uint8)
    for obstacle in basin.settings.obstacles:
        away = [x[None, :] - obstacle.position[0], y[:, None] - obstacle.position[1]]
        if basin.periodic:
            away = [d - side * np.round(d / side) for d, side in zip(away, basin.size, strict=True)]
        if obstacle.radius is not None:
            inside = np.hypot(*away) <= obstacle.radius
        else:
            assert obstacle.size is not None
            half = 0.5 * np.asarray(obstacle.size)
            inside = (np.abs(away[0]) <= half[0]) & (np.abs(away[1]) <= half[1])
        solid[inside] = 1
    if solid.all():
        raise InputError("water.simulation.obstacles: expected some open water, and they cover all of it")
    return solid if solid.any() else None
