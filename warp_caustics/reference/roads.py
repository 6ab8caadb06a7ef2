"""The two roads to the reference, walked once: a mesh of so many cells a pixel, or so many jittered photons."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..kernels.reference.cells import ARRIVED, Mesh2D, make_cells, make_rays
from ..kernels.reference.land import make_land
from ..kernels.reference.ledger import BINS, ENTRIES
from ..kernels.reference.photons import Disk, make_photons
from ..sun import disk_directions
from ..window import lattice_over
from .world import DeviceWorld

if TYPE_CHECKING:
    from ..facts import Facts
    from ..window import Lattice

STRIP_CORNERS = 2**17
"""Corners worked on at a time: a few megabytes."""

LAND_ROWS = 16
"""Rows of pixels of a job in which land is looked at."""

SEEDS_APART = 2**20
"""Between the seeds of two maps: more than there are rows of photons."""


@dataclass(frozen=True)
class Sums:
    """What one walk gathered, at unit irradiance: flux ``[rows, columns, channels]`` and the ledger [W]."""

    flux: np.ndarray
    ledger: dict[str, np.ndarray]


class Roads:
    """Walks a scene at a time, by either road, on a device."""

    def __init__(self, facts: Facts, time: float, device: str, threads: int) -> None:
        self._facts, self._device, self._threads = facts, device, threads
        self._owner = DeviceWorld(facts, time, device)
        self._stop = threading.Event()

    def cells(self, per_side: int, directions: int) -> Sums:
        """Walk by cells, ``per_side`` along a pixel's side, for each of so many directions of the sun's disk."""
        facts = self._facts
        rays, cells = make_rays(facts.spec), make_cells(facts.spec)
        mesh, lattice = self._mesh(per_side)
        rows = self._rows(lattice)
        suns, share = self._suns(directions)
        columns = lattice.count[0]

        def allocate() -> tuple[Any, Any]:
            corners = (rows + 1, columns + 1)
            planes = (ARRIVED + facts.spec.channels, *corners)
            return (wp.empty(planes, dtype=wp.float64, device=self._device),
                    wp.empty(corners, dtype=wp.uint8, device=self._device))  # fmt: skip

        def walk(job: tuple[int, int], own: tuple[Any, Any], map: Any, ledger: Any) -> None:
            k, first = job
            world, sun = self._owner.world, wp.vec3d(*suns[k])
            strip = min(rows, lattice.first[1] + lattice.count[1] - first)
            self._launch(rays, (strip + 1, columns + 1), [world, sun, mesh, first, *own])
            self._launch(cells, (strip, columns), [world, sun, mesh, first, *own, map, ledger])

        jobs = [(k, first) for k in range(len(suns)) for first in self._strips(lattice, rows)]
        return self._walk(jobs, allocate, walk, share)

    def photons(self, per_side: int, seed: int) -> Sums:
        """Walk by photons: one from a random place of each of ``per_side`` by ``per_side`` cells a pixel."""
        facts = self._facts
        half = np.radians(facts.scene.sun.angular_diameter) / 2.0
        kernel = make_photons(facts.spec, bool(half > 0.0))
        mesh, lattice = self._mesh(per_side)
        rows = self._rows(lattice)
        disk = self._disk(half)
        # Where a plane faces the disk's middle, the mean cosine over it is (1 + cos half) / 2.
        share = 2.0 / (1.0 + np.cos(half))
        first_seed = seed * SEEDS_APART - lattice.first[1]

        def walk(first: int, own: None, map: Any, ledger: Any) -> None:
            strip = min(rows, lattice.first[1] + lattice.count[1] - first)
            world = self._owner.world
            self._launch(kernel, (strip, lattice.count[0]), [world, disk, mesh, first, first_seed, map, ledger])

        return self._walk(self._strips(lattice, rows), lambda: None, walk, share)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of the water that was walked."""
        return self._owner.notes

    def land(self, parts: int) -> np.ndarray:
        """Direct sunlight on dry land, by horizontal area at unit irradiance ``[rows, columns]``.

        Each pixel is looked at in ``parts`` by ``parts`` points, and in more where a shore or a shadow crosses it.
        """
        facts = self._facts
        columns, rows = facts.scene.map.resolution
        if not facts.spec.shore:
            return np.zeros((rows, columns))
        made = wp.zeros(rows * columns, dtype=wp.float64, device=self._device)
        suns: wp.array = wp.array(facts.suns, dtype=wp.vec3d, device=self._device)
        kernel = make_land(facts.spec)

        def light(first: int, own: None) -> None:
            band = min(LAND_ROWS, rows - first)
            self._launch(kernel, (band, columns), [self._owner.world, suns, first, columns, parts, made])

        self._share(list(range(0, rows, LAND_ROWS)), lambda: None, light)
        return np.asarray(made.numpy()).reshape(rows, columns) * facts.sun_share

    def _walk(
        self,
        jobs: list[Any],
        allocate: Callable[[], Any],
        walk: Callable[[Any, Any, Any, Any], None],
        share: float,
    ) -> Sums:
        """Walk every job; each thread takes every so-many-eth and adds to a map of its own."""
        facts = self._facts
        columns, rows = facts.scene.map.resolution
        channels = facts.spec.channels
        lanes = min(self._threads, len(jobs))
        maps = wp.zeros((lanes, rows * columns * channels), dtype=wp.float64, device=self._device)
        ledgers = wp.zeros((lanes, len(ENTRIES) * channels, BINS), dtype=wp.float64, device=self._device)
        free = list(range(lanes))
        self._share(
            jobs,
            lambda: (free.pop(), allocate()),
            lambda job, own: walk(job, own[1], maps[own[0]], ledgers[own[0]]),
        )
        sums = ledgers.numpy().sum(axis=(0, 2)).reshape(len(ENTRIES), channels) * share
        flux = maps.numpy().sum(axis=0).reshape(rows, columns, channels) * share
        return Sums(flux, dict(zip(ENTRIES, sums, strict=True)))

    def _share(self, jobs: list[Any], prepare: Callable[[], Any], work: Callable[[Any, Any], None]) -> None:
        """Do jobs on all threads, each with what it prepares for itself; Ctrl-C ends them after the job in hand."""
        lanes = min(self._threads, len(jobs))

        def run(lane: int) -> None:
            own = prepare()
            for job in jobs[lane::lanes]:
                if self._stop.is_set():
                    return
                work(job, own)

        with ThreadPoolExecutor(lanes) as pool:
            try:
                list(pool.map(run, range(lanes)))
            except BaseException:
                self._stop.set()
                raise

    def _launch(self, kernel: wp.Kernel, dim: tuple[int, ...], arguments: list[Any]) -> None:
        wp.launch(kernel, dim=dim, inputs=arguments, device=self._device)

    def _mesh(self, per_side: int) -> tuple[Mesh2D, Lattice]:
        facts = self._facts
        low, high = facts.deviation
        shift = facts.rest_shifts.mean(axis=0)
        # One mesh serves all directions of the disk: it is wider by how far their light is apart, edge to edge.
        spare = (np.abs(facts.rest_shifts - shift).max(axis=0) * 2.0) / facts.pixel
        lattice = lattice_over(low - spare, high + spare, facts.scene.map.resolution, 1.0 / per_side)
        mesh = Mesh2D()
        mesh.step = 1.0 / per_side
        mesh.first = wp.vec2i(*lattice.first)
        mesh.shift = wp.vec2d(*shift)
        mesh.size = wp.vec2i(*facts.scene.map.resolution)
        return mesh, lattice

    @staticmethod
    def _rows(lattice: Lattice) -> int:
        return int(np.clip(STRIP_CORNERS // lattice.count[0], 1, lattice.count[1]))

    @staticmethod
    def _strips(lattice: Lattice, rows: int) -> list[int]:
        return list(range(lattice.first[1], lattice.first[1] + lattice.count[1], rows))

    def _suns(self, directions: int) -> tuple[np.ndarray, float]:
        """Directions of the disk, and the irradiance of one."""
        sun = self._facts.scene.sun
        middle = np.asarray(sun.unit_direction, dtype=np.float64)
        suns = disk_directions(middle, np.radians(sun.angular_diameter) / 2.0, directions)
        return suns, float(1.0 / (suns @ middle).sum())

    def _disk(self, half: float) -> Disk:
        middle = np.asarray(self._facts.scene.sun.unit_direction, dtype=np.float64)
        right = np.cross(middle, np.eye(3)[np.argmin(np.abs(middle))])
        right /= np.linalg.norm(right)
        disk = Disk()
        disk.middle, disk.right = wp.vec3d(*middle), wp.vec3d(*right)
        disk.up = wp.vec3d(*np.cross(middle, right))
        disk.height = 1.0 - np.cos(half)
        return disk
