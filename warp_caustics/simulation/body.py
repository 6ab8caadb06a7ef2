"""What all water has in common that is made on the device before a frame: its rectangle, its cells, its bounds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class WaterBody:
    """Water whose surface is made anew for each frame, at the middles of cells.

    Attributes
    ----------
    origin, size : (float, float)
        The rectangle, in the world [m].
    rows, columns : int
        Its cells.
    depth : float
        Of the water at rest [m].
    """

    origin: tuple[float, float]
    size: tuple[float, float]
    rows: int
    columns: int
    depth: float

    @property
    def summary(self) -> str:
        """What it is, in words."""
        raise NotImplementedError

    @property
    def fineness(self) -> str:
        """Path in the scene of the key that says how fine its cells are."""
        raise NotImplementedError

    @property
    def spectral(self) -> bool:
        """True where modes are propagated; else cells are."""
        raise NotImplementedError

    @property
    def periodic(self) -> bool:
        """True where the water repeats; else it ends at walls."""
        raise NotImplementedError

    @property
    def max_slope(self) -> float:
        """Steepest slope that is planned for, at cells and half-way between."""
        raise NotImplementedError

    @property
    def max_height(self) -> float:
        """Largest displacement that is planned for [m]."""
        raise NotImplementedError

    @property
    def cell(self) -> tuple[float, float]:
        """Sides of a cell [m]."""
        return self.size[0] / self.columns, self.size[1] / self.rows

    @property
    def extent(self) -> str:
        """Where the water is, in words."""
        (x, y), (width, height) = self.origin, self.size
        return f"x {x:g} to {x + width:g} m, y {y:g} to {y + height:g} m"
