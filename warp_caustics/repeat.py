"""Water that repeats: in space, so that a map is a tile, and in time, so that its frames are a loop.

What does not repeat by itself is moved to the nearest that does, and every move is told; what cannot be moved is
refused, all of it in one message.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .assets import load_assets
from .errors import InputError
from .receiver import receiver_kind, rest_depth
from .scene import Scene, TerrainWave, Water, Wave
from .scene.faults import gathered
from .scene.spectrum import Spectrum
from .water import angular_frequency, is_radial

DECIMALS = 5e-3
"""Share of a wave by which a tile may be missed without being asked: wavevectors are written in a few decimals."""

EXACT = 1e-12
"""Relative difference that is rounding in float64, and no move."""

COUNTS = ("samples_per_pixel", "photons_per_pixel")
"""Settings of methods that say how many cells of the water there are for each pixel."""


@dataclass(frozen=True)
class Change:
    """A value of a scene that was moved so that the water repeats.

    Attributes
    ----------
    key : str
        Path in the scene file.
    before, after : tuple of float
        The value, in the file's units.
    note : str
        By how much, in words.
    """

    key: str
    before: tuple[float, ...]
    after: tuple[float, ...]
    note: str

    @property
    def relative(self) -> float:
        """Length of the move over that of what was moved; infinite where it was zero."""
        length = float(np.linalg.norm(self.before))
        return float(np.linalg.norm(np.subtract(self.after, self.before))) / length if length else math.inf

    def __str__(self) -> str:
        return f"{self.key}: {_shown(self.before)} to {_shown(self.after)} ({self.note})"


PANS = "pattern"
"""The method that moves a picture, and does not look at the waves."""

PATTERN_REPEATS = 4.0
"""Repeats of its texture after which both layers are where they were: they move by 1 and by 0.75 times its speed."""

MIRRORS = "sample"
"""The method that takes the water beyond the map for its mirror image."""


def tiled(scene: Scene, method: str | None = None, rounding: bool = False) -> tuple[Scene, tuple[Change, ...]]:
    """Make a scene whose caustic map is one period of an endless pattern: a tile.

    A wave fits if the map's sides are whole numbers of its waves: k = 2 pi (i / width, j / height). So must the cells
    of the water, or the last ones before a seam would not be those before the next.

    Parameters
    ----------
    scene : Scene
        Waves over a plane or over a closed terrain that repeats too.
    method : str, optional
        The method that will make the map; that of the scene if not given.
    rounding : bool
        Move what does not fit to the nearest that does, instead of refusing it.

    Returns
    -------
    Scene
        The scene with what was moved.
    tuple of Change
        The moves: those that were asked for, and those within :data:`DECIMALS` that make decimals exact.

    Raises
    ------
    InputError
        With all that does not fit, each with the nearest that would.
    """
    fit = _Fit(scene.map.size, rounding)
    name = scene.method.name if method is None else method
    fit.faults += _endings(scene, name)
    water, receiver = _with_waves(scene), scene.receiver
    if water.waves is not None:
        water = water.model_copy(update={"waves": fit.waves("water.waves", water.waves)})
    spectrum = water.spectrum
    if spectrum is not None:
        fit.period("water.spectrum.period", spectrum.period)
    if receiver_kind(scene) == "waves":
        terrain: Any = receiver.terrain
        moved = terrain.model_copy(update={"waves": fit.waves("receiver.terrain.waves", terrain.waves)})
        receiver = receiver.model_copy(update={"terrain": moved})
    settings = fit.cells(scene, name)
    if fit.faults:
        width, height = scene.map.size
        hint = "; rounding moves the water to the nearest" if fit.movable else ""
        raise gathered(fit.faults, f"a map of {width:g} x {height:g} m is no tile{hint}")
    return scene.model_copy(update={"water": water, "receiver": receiver, "method": settings}), tuple(fit.changes)


def looping(scene: Scene, seconds: float, method: str | None = None) -> tuple[Scene, tuple[Change, ...]]:
    """Make a scene whose water is after a time as it was before: every wave then runs a whole number of its periods.

    Frequencies that follow from the dispersion relation are taken at the scene's depth, moved to the nearest multiple
    of 2 pi / T, and given as `angular_frequency`. A wave that moves keeps moving: it gets one period at least.

    Parameters
    ----------
    scene : Scene
        Water of waves, or of a spectrum that can loop.
    seconds : float
        T, the length of the loop [s].
    method : str, optional
        The method that will make the frames; that of the scene if not given. A pattern moves by a speed of its own.

    Returns
    -------
    Scene
        The scene with what was moved.
    tuple of Change
        The moves.

    Raises
    ------
    InputError
        If the length is no time, or the water does not move, or not periodically.
    """
    if not 0.0 < seconds < math.inf:
        raise InputError(f"loop: expected a finite number of seconds above 0, got {seconds}")
    if (scene.method.name if method is None else method) == PANS:
        return _looping_pattern(scene, seconds)
    water = _with_waves(scene)
    if water.spectrum is not None:
        return _looping_sea(scene, water.spectrum, seconds)
    if water.simulation is not None:
        raise InputError("loop: water.simulation never comes back to where it was; waves do")
    if is_radial(scene):
        raise InputError('loop: the rings of water.preset "radial" have a speed of their own; waves can be moved')
    if water.height_map is not None or not water.waves:
        raise InputError("loop: the water does not move, so one frame is all there is; leave the loop out")
    k = np.hypot(*np.transpose([wave.wavevector for wave in water.waves]))
    own = angular_frequency(k, rest_depth(scene, load_assets(scene)))
    waves, changes = [], []
    for i, wave in enumerate(water.waves):
        omega = float(own[i]) if wave.angular_frequency is None else wave.angular_frequency
        turns = math.copysign(max(1.0, round(abs(omega) * seconds / (2.0 * math.pi))), omega) if omega else 0.0
        looped = 2.0 * math.pi * turns / seconds
        if abs(looped - omega) > EXACT * abs(omega):
            note = f"speed {_percent(looped / omega - 1.0)}"
            changes.append(Change(f"water.waves[{i}].angular_frequency", (omega,), (looped,), note))
        waves.append(wave.model_copy(update={"angular_frequency": looped}))
    moved = water.model_copy(update={"waves": tuple(waves)})
    return scene.model_copy(update={"water": moved}), tuple(changes)


def _looping_sea(scene: Scene, spectrum: Spectrum, seconds: float) -> tuple[Scene, tuple[Change, ...]]:
    """As :func:`looping`, by the spectrum's own key."""
    from .simulation import make_sea

    if spectrum.loop == seconds:
        return scene, ()
    looped = spectrum.model_copy(update={"loop": seconds})
    moved = make_sea(looped, rest_depth(scene, load_assets(scene))).moved
    before = () if spectrum.loop is None else (spectrum.loop,)
    change = Change("water.spectrum.loop", before, (seconds,), f"frequencies by up to {100.0 * moved:.2g} %")
    return scene.model_copy(update={"water": scene.water.model_copy(update={"spectrum": looped})}), (change,)


class _Fit:
    """Fits what repeats to one tile, and gathers what was moved and what cannot be."""

    def __init__(self, size: Sequence[float], rounding: bool) -> None:
        self.size, self.rounding = np.asarray(size, dtype=np.float64), rounding
        self.changes: list[Change] = []
        self.faults: list[str] = []
        self.movable = False

    def waves(self, key: str, waves: Sequence[Wave | TerrainWave]) -> tuple[Wave | TerrainWave, ...]:
        """Return the waves with wavevectors that fit."""
        return tuple(
            wave.model_copy(update={"wavevector": self._wavevector(f"{key}[{i}].wavevector", wave.wavevector)})
            for i, wave in enumerate(waves)
        )

    def _wavevector(self, key: str, wavevector: tuple[float, float]) -> tuple[float, float]:
        across = np.asarray(wavevector) * self.size / (2.0 * np.pi)
        whole = np.round(across)
        if not whole.any():
            self.faults.append(
                f"{key}: {_shown(wavevector)} is more than two tiles long: leave it out, or make map.size larger"
            )
            return wavevector
        x, y = (float(k) for k in 2.0 * np.pi * whole / self.size + 0.0)  # no minus zero
        change = Change(key, wavevector, (x, y), _turned(wavevector, (x, y)))
        if np.abs(across - whole).max() > DECIMALS and not self.rounding:
            self.movable = True
            self.faults.append(
                f"{key}: {_shown(wavevector)} does not fit; the nearest is {_shown((x, y))} ({change.note})"
            )
        elif change.relative > EXACT:
            self.changes.append(change)
        return x, y

    def period(self, key: str, period: float) -> None:
        """Refuse a tile that is not a whole number of periods."""
        count = self.size / period
        whole = np.maximum(np.round(count), 1.0)
        if np.abs(count - whole).max() > EXACT * whole.max():
            self.faults.append(
                f"{key}: {period:g} m; the nearest map.size of whole periods is {_shown(whole * period)}"
            )

    def cells(self, scene: Scene, name: str) -> Any:
        """Return the scene's `method` with whole cells of the water across the tile, both ways."""
        method = scene.method
        settings: Any = getattr(method, name, None)
        for field in COUNTS:
            count = getattr(settings, field, None)
            if count is None:
                continue
            # Cells are as wide as high in pixels: whole ones across both sides are so across their common divisor.
            pixels = math.gcd(*scene.map.resolution)
            cells = math.sqrt(count) * pixels
            fitting = (max(1, round(cells)) / pixels) ** 2
            change = Change(f"method.{name}.{field}", (count,), (fitting,), _percent(fitting / count - 1.0))
            if change.relative > EXACT and not self.rounding:
                self.faults.append(
                    f"{change.key}: {count:g} puts {cells:.6g} cells on {pixels} pixels, and they do not meet at the "
                    f"seam; the nearest that do are {fitting:.12g}"
                )
            elif change.relative > EXACT:
                self.changes.append(change)
                method = method.model_copy(update={name: settings.model_copy(update={field: fitting})})
        return method


def _with_waves(scene: Scene) -> Water:
    """Return the water, a preset's waves given one by one so that they can be moved."""
    if scene.water.preset is None or is_radial(scene):
        return scene.water
    return scene.water.model_copy(update={"preset": None, "waves": scene.waves})


def _looping_pattern(scene: Scene, seconds: float) -> tuple[Scene, tuple[Change, ...]]:
    """Move a pattern's speed to the nearest at which it loops; one that moves keeps moving."""
    settings = scene.method.pattern
    if settings.speed == 0.0:
        raise InputError("loop: method.pattern.speed is 0, so one frame is all there is; leave the loop out")
    rounds = math.copysign(max(1.0, round(abs(settings.speed) * seconds / PATTERN_REPEATS)), settings.speed)
    speed = PATTERN_REPEATS * rounds / seconds
    if abs(speed - settings.speed) <= EXACT * abs(settings.speed):
        return scene, ()
    note = f"speed {_percent(speed / settings.speed - 1.0)}"
    moved = scene.method.model_copy(update={"pattern": settings.model_copy(update={"speed": speed})})
    change = Change("method.pattern.speed", (settings.speed,), (speed,), note)
    return scene.model_copy(update={"method": moved}), (change,)


def _endings(scene: Scene, method: str) -> Iterator[str]:
    """Yield what of a scene ends, or stands in one place, and so cannot be repeated."""
    water, receiver, kind = scene.water, scene.receiver, receiver_kind(scene)
    if water.height_map is not None:
        yield "water.height_map: ends at its border; waves do not"
    if water.simulation is not None:
        yield "water.simulation: is not made to fit; waves are"
    if is_radial(scene):
        yield 'water.preset: the rings of "radial" have one middle; waves have none'
    if kind == "mesh":
        yield "receiver.mesh: stands in one place; a plane does not"
    if kind == "grid":
        yield "receiver.terrain: a file ends at its border; a plane does not, nor a terrain in closed form"
    if kind == "waves" and tuple(receiver.terrain.slope) != (0.0, 0.0):  # type: ignore[union-attr]
        yield f"receiver.terrain.slope: {_shown(receiver.terrain.slope)} makes a step at each seam; [0, 0] does not"  # type: ignore[union-attr]
    if receiver.objects:
        yield "receiver.objects: stand in one place; leave them out"
    if method == MIRRORS:
        yield f'method "{method}": mirrors the water at the border, as published; methods that follow light do not'


def _turned(before: Sequence[float], after: Sequence[float]) -> str:
    """Say in words how a wavevector was moved."""
    length = math.hypot(*before) / math.hypot(*after) - 1.0
    cross, dot = before[0] * after[1] - before[1] * after[0], before[0] * after[0] + before[1] * after[1]
    return f"wavelength {_percent(length)}, turned by {math.degrees(math.atan2(cross, dot)):.2g} degrees"


def _percent(share: float) -> str:
    return f"{100.0 * share:+.2g} %"


def _shown(values: Sequence[float] | np.ndarray) -> str:
    numbers = ", ".join(f"{value:.6g}" for value in values)
    if not len(values):
        return "none"
    return numbers if len(values) == 1 else f"[{numbers}]"
