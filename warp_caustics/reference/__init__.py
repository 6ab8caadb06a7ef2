"""The converged caustic map that methods are judged by: float64, and no kernel of theirs."""

from __future__ import annotations

import os
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ..assets import load_assets
from ..device import free_memory, resolve_device, resolve_threads
from ..dispersion import CHANNELS, channel_scene, own_channel, stacked_energy
from ..energy import Energy
from ..errors import InputError
from ..facts import gather_facts, with_placed_water
from ..ledger import beyond_border
from ..magnitude import check_asset_magnitudes, check_magnitudes
from ..scene import Scene, load_scene
from ..water import check_time
from . import cache as disk
from .converge import LAND_PARTS, Budget, Level, converge
from .plan import plan_reference
from .roads import Roads

if TYPE_CHECKING:
    from ..facts import Facts

__all__ = ["Reference", "jittered_photons", "make_reference"]


@dataclass(frozen=True)
class Reference:
    """A converged caustic map, and how wrong it may be.

    Attributes
    ----------
    caustic_map : ndarray
        float64 ``[rows, columns]`` or ``[rows, columns, 3]``, in the units of ``sun.irradiance``.
    energy : Energy
        Its ledger [W].
    error_bar : float
        Relative L2 error (RMSE over mean) that it may have: by how much its last two levels differ.
    samples : float
        Cells per pixel of the last level, all directions of the sun's disk together.
    seconds : float
        It took to compute.
    cached : bool
        Whether it was read from the disk.
    notes : tuple of str
        What is to be known of it.
    """

    caustic_map: np.ndarray
    energy: Energy
    error_bar: float
    samples: float
    seconds: float
    cached: bool
    notes: tuple[str, ...] = ()


def make_reference(
    scene: Scene | str | os.PathLike[str],
    time: float = 0.0,
    *,
    tolerance: float | None = None,
    device: str | None = None,
    threads: int | None = None,
    cache: bool = True,
) -> Reference:
    """Compute the converged caustic map of a scene, or read it from the disk.

    A mesh of the water is refracted and each landed triangle clipped to its pixels; the mesh is made twice as fine
    until two answers agree. Cells that an edge of light and shadow cuts, and all that light a mesh, are followed ray by
    ray instead. Everything is float64, by kernels that no method shares (``kernels/reference``);
    :func:`jittered_photons` is a second road to the same map.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file. Its method and camera do not matter.
    time : float
        [s].
    tolerance : float, optional
        Relative L2 difference at which to stop; the scene's ``method.reference.tolerance`` if not given.
    device, threads
        As for :func:`~warp_caustics.make_plan`.
    cache : bool
        Read the answer from the disk if it is there, and leave it there if it is not. It is named by the content of
        the scene and its files, the time, the tolerance and the reference's own code.

    Returns
    -------
    Reference
        Its ``error_bar`` may be above the tolerance, when rays run out.

    Raises
    ------
    InputError
        If the scene, device, threads, time or tolerance cannot be used.
    """
    facts, device, threads = _prepared(scene, time, device, threads)
    if facts.scene.medium.dispersion != "none":
        return _dispersed(with_placed_water(facts.scene, facts.assets), time, tolerance, device, threads, cache)
    settings = facts.scene.method.reference
    budget = Budget(settings.tolerance if tolerance is None else tolerance, settings.rays)
    if not (budget.tolerance > 0.0 and np.isfinite(budget.tolerance)):
        raise InputError(f"tolerance: expected a finite number above 0, got {tolerance}")
    name = disk.key(facts, time, budget)
    stored = disk.load(name) if cache else None
    if stored is not None:
        return Reference(**stored, cached=True)
    plan_reference(facts, device, threads, free_memory(device))  # refuses what would take days, or more memory
    start = perf_counter()
    roads = Roads(facts, time, device, threads)
    level = converge(roads, facts, budget)
    made = _reference(facts, level, roads.notes, perf_counter() - start)
    if cache:
        disk.store(name, made)
    return made


def _dispersed(scene: Scene, time: float, tolerance: float | None, device: str, threads: int, cache: bool) -> Reference:
    """Converge each channel by itself."""
    made = [
        make_reference(channel_scene(scene, c), time, tolerance=tolerance, device=device, threads=threads, cache=cache)
        for c in range(len(CHANNELS))
    ]
    caustic_map = np.stack([own_channel(np.atleast_3d(one.caustic_map), c) for c, one in enumerate(made)], axis=-1)
    # Each bar is an error over its own channel's mean; together they are one over the mean of all.
    errors = [one.error_bar * caustic_map[..., c].mean() for c, one in enumerate(made)]
    mean = float(caustic_map.mean())
    return Reference(
        caustic_map=caustic_map,
        energy=stacked_energy([one.energy for one in made]),
        error_bar=float(np.sqrt(np.mean(np.square(errors)))) / mean if mean > 0.0 else 0.0,
        samples=float(np.mean([one.samples for one in made])),
        seconds=sum(one.seconds for one in made),
        cached=all(one.cached for one in made),
        notes=tuple(dict.fromkeys(note for one in made for note in one.notes)),
    )


def jittered_photons(
    scene: Scene | str | os.PathLike[str],
    time: float = 0.0,
    *,
    per_side: int,
    seed: int = 0,
    device: str | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Compute a caustic map by the reference's second road alone: a photon from a random place of each cell.

    Parameters
    ----------
    scene, time, device, threads
        As for :func:`make_reference`.
    per_side : int
        Photons along a pixel's side.
    seed : int
        Of the random places; maps of different seeds are independent.

    Returns
    -------
    ndarray
        float64 ``[rows, columns]`` or ``[rows, columns, 3]``.
    """
    facts, device, threads = _prepared(scene, time, device, threads)
    if facts.scene.medium.dispersion != "none":
        placed = with_placed_water(facts.scene, facts.assets)
        channels = [
            jittered_photons(
                channel_scene(placed, c), time, per_side=per_side, seed=seed, device=device, threads=threads
            )
            for c in range(len(CHANNELS))
        ]
        return np.stack([own_channel(np.atleast_3d(one), c) for c, one in enumerate(channels)], axis=-1)
    roads = Roads(facts, time, device, threads)
    return _map(facts, roads.photons(per_side, seed).flux, roads.land(LAND_PARTS * per_side))


def _prepared(
    scene: Scene | str | os.PathLike[str],
    time: float,
    device: str | None,
    threads: int | None,
) -> tuple[Facts, str, int]:
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    check_time(time)
    device = resolve_device(device)
    check_magnitudes(scene)
    assets = load_assets(scene)
    check_asset_magnitudes(assets)
    return gather_facts(scene, assets), device, resolve_threads(threads, device)


def _reference(facts: Facts, level: Level, notes: tuple[str, ...], seconds: float) -> Reference:
    land = level.land
    caustic_map = _map(facts, level.sums.flux, land)
    colours, area = np.asarray(facts.irradiance), float(np.prod(facts.pixel))
    entries = {name: value * colours for name, value in level.sums.ledger.items()}
    beyond = beyond_border(facts) * colours
    entries["emitted"] = entries["emitted"] + beyond
    entries["missed_by_window"] = beyond
    entries["dry"] = land.sum() * area * colours
    energy = Energy(**{name: float(value[0]) if len(colours) == 1 else value for name, value in entries.items()})
    samples = float(level.per_side**2 * max(level.directions, 1))
    return Reference(caustic_map, energy, level.error_bar, samples, seconds, False, notes)


def _map(facts: Facts, flux: np.ndarray, land: np.ndarray) -> np.ndarray:
    columns, rows = facts.scene.map.resolution
    caustic_map = (flux / float(np.prod(facts.pixel)) + land[..., None]) * np.asarray(facts.irradiance)
    return caustic_map.reshape(rows, columns, 3) if len(facts.irradiance) == 3 else caustic_map.reshape(rows, columns)
