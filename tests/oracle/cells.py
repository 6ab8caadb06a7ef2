"""The flux of surface cells, laid down where it lands."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from oracle.clip import deposit_points, deposit_triangles
from oracle.rays import FLUXES, LANDS, LEFT, MISSED, Rays, trace_points
from oracle.setting import Setting
from oracle.surfaces import Array

TEAR = 8.0  # a landing cell longer than this many times its rest size may be torn by a silhouette: it is split
SPLIT = 4  # parts, each way, of a cell whose corners meet different fates


@dataclass
class Deposit:
    """What has been laid down so far.

    Attributes
    ----------
    setting : Setting
    splits : int
        How many times a cell is split whose corners meet different fates, before its corners become points.
    falling : bool
        Cut cells into triangles along the diagonal that falls, instead of the one that rises from their first corner.
    image : array [channels, rows, columns]
        Flux by pixel [W].
    energy : dict of arrays [channels]
        The ledger [W], without ``received``.
    """

    setting: Setting
    splits: int
    falling: bool = False
    image: Array = field(init=False)
    energy: dict[str, Array] = field(init=False)

    def __post_init__(self) -> None:
        """Begin with nothing."""
        columns, rows = self.setting.resolution
        self.image = np.zeros((self.setting.channels, rows, columns))
        names = ("emitted", "reflected", "absorbed", "outside_map", "left_water", "over_lit")
        self.energy = {name: np.zeros(self.setting.channels) for name in names}

    def add_lattice(self, rays: Rays, u: Array, v: Array) -> None:
        """Add the cells of the lattice v × u, whose corners have been traced."""
        corners = [
            rays.pick((slice(i, i + v.size - 1), slice(j, j + u.size - 1))) for j, i in ((0, 0), (1, 0), (1, 1), (0, 1))
        ]
        x, y = np.meshgrid(u[:-1], v[:-1])
        self._add(_stack(corners), x.ravel(), y.ravel(), u[1] - u[0], v[1] - v[0], 0)

    def _add(self, rays: Rays, x: Array, y: Array, width: float, height: float, depth: int) -> None:
        """Add cells with corners [4, n], counterclockwise from (x, y)."""
        whole = (rays.fate == rays.fate[0]).all(axis=0) & ~self._torn(rays, width, height)
        self._add_whole(rays.pick((slice(None), whole)), 0.25 * width * height)
        if whole.all():
            return
        if depth == self.splits:
            self._add_points(rays.pick((slice(None), ~whole)), 0.25 * width * height)
            return
        x, y = x[~whole], y[~whole]
        step = np.arange(SPLIT + 1) / SPLIT
        fine = trace_points(
            self.setting,
            np.broadcast_to(x + width * step[None, :, None], (SPLIT + 1, SPLIT + 1, x.size)),
            np.broadcast_to(y + height * step[:, None, None], (SPLIT + 1, SPLIT + 1, x.size)),
        )
        near, far = slice(0, SPLIT), slice(1, SPLIT + 1)
        corners = [fine.pick((i, j, slice(None))) for j, i in ((near, near), (far, near), (far, far), (near, far))]
        part_x = np.broadcast_to(x + width * step[None, :-1, None], (SPLIT, SPLIT, x.size)).ravel()
        part_y = np.broadcast_to(y + height * step[:-1, None, None], (SPLIT, SPLIT, x.size)).ravel()
        self._add(_stack(corners), part_x, part_y, width / SPLIT, height / SPLIT, depth + 1)

    def _torn(self, rays: Rays, width: float, height: float) -> npt.NDArray[np.bool_]:
        """Tell which cells land so far apart that the edge of a hill may lie between. A plane has no hills."""
        if self.setting.floor.amplitude.size == 0:
            return np.zeros(rays.fate.shape[1], dtype=np.bool_)
        pixel = self.setting.pixel
        limit = TEAR * max(width / pixel[0], height / pixel[1])
        return np.asarray(np.maximum(np.ptp(rays.x, axis=0), np.ptp(rays.y, axis=0)) > limit)

    def _add_whole(self, rays: Rays, quarter: float) -> None:
        """Add cells whose four corners share their fate: two triangles each, with the mean flux of their corners."""
        self._book(rays, quarter)
        lands = rays.fate[0] == LANDS
        x, y, carried = rays.x[:, lands], rays.y[:, lands], rays.carried[:, :, lands]
        one, two = ([0, 1, 3], [1, 2, 3]) if self.falling else ([0, 1, 2], [0, 2, 3])
        corner_x, corner_y = (np.concatenate([a[one], a[two]], axis=1) for a in (x, y))
        flux = np.tile(carried.sum(axis=1) * 0.5 * quarter, 2)
        self.energy["outside_map"] += deposit_triangles(self.image, corner_x, corner_y, flux)

    def _add_points(self, rays: Rays, quarter: float) -> None:
        """Add the last, smallest cells on an edge: each corner stands for a quarter of its cell."""
        self._book(rays, quarter)
        lands = rays.fate == LANDS
        flux = rays.carried[:, lands] * quarter
        self.energy["outside_map"] += deposit_points(self.image, rays.x[lands], rays.y[lands], flux)

    def _book(self, rays: Rays, quarter: float) -> None:
        """Enter all but what lands into the ledger."""
        for name in ("emitted", "reflected", "absorbed", "over_lit"):
            self.energy[name] += quarter * getattr(rays, name).sum(axis=(1, 2))
        for name, fate in (("left_water", LEFT), ("outside_map", MISSED)):
            self.energy[name] += quarter * rays.carried[:, rays.fate == fate].sum(axis=1)


def _stack(corners: list[Rays]) -> Rays:
    """Join four corners, each of any shape, to arrays [4, n] and fluxes [channels, 4, n]."""
    flat = [np.stack([getattr(c, name).ravel() for c in corners]) for name in ("fate", "x", "y")]
    channels = corners[0].emitted.shape[0]
    fluxes = [np.stack([getattr(c, name).reshape(channels, -1) for c in corners], axis=1) for name in FLUXES]
    return Rays(*flat, *fluxes)
