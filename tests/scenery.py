"""Small scenes for the tests of the whole library, and the few ways in which they are changed and looked at.

Kernels are specialised by what a scene needs, and each specialisation costs seconds to compile: tests that can share
one do, by building their scenes here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import warp_caustics as wc
from oracle.cases import sunlight

IOR = 1.333
LEDGER = 1e-6  # a float32 map against a float64 ledger
LOSSES = ("received", "reflected", "absorbed", "outside_map", "left_water", "blocked", "missed_by_window", "dropped")

METHODS = ("beam", "photon", "gather")
FREE_METHODS = ("beam", "photon")  # take any receiver
ANY_SUN = sunlight(35.0)


def wave(amplitude: float, kx: float, ky: float, phase: float = 0.0, **more: float) -> dict[str, Any]:
    """Give one wave as a scene file would."""
    return {"amplitude": amplitude, "wavevector": (kx, ky), "phase": phase, **more}


GENTLE = (wave(0.02, 3.0, 1.0, 0.3), wave(0.01, -4.0, 5.0, 1.0), wave(0.005, 9.0, -7.0, 2.0))
"""Slopes up to 0.18: under a sun down to 75° from the zenith no crest shades, and no ray meets the surface again."""


def scene(
    waves: Any = (),
    receiver: Any = None,
    direction: Any = ANY_SUN,
    medium: Any = None,
    *,
    resolution: tuple[int, int] = (40, 28),
    size: tuple[float, float] = (2.0, 1.1),
    origin: tuple[float, float] = (0.0, 0.0),
    level: float = 1.0,
    height_map: dict[str, Any] | None = None,
    simulation: dict[str, Any] | None = None,
    spectrum: dict[str, Any] | None = None,
    preset: str | None = None,
    self_shadow: str | bool = "auto",
    sun: dict[str, Any] | None = None,
    method: dict[str, Any] | None = None,
    camera: dict[str, Any] | None = None,
) -> wc.Scene:
    """Make a scene of one metre of water over a flat floor at z = 0, with pixels that are not square."""
    kinds: dict[str, Any] = {
        "height_map": height_map,
        "simulation": simulation,
        "spectrum": spectrum,
        "preset": preset,
    }
    water = {name: given for name, given in kinds.items() if given is not None} or {"waves": list(waves)}
    return wc.Scene(
        water={"level": level, "self_shadow": self_shadow, **water},
        receiver={"plane": 0.0} if receiver is None else receiver,
        sun={"direction": direction, **(sun or {})},
        medium={"ior": IOR} if medium is None else medium,
        map={"origin": origin, "size": size, "resolution": resolution},
        method=method or {},
        camera=camera,
    )


def bundled(name: str, resolution: tuple[int, int] = (48, 48)) -> wc.Scene:
    """Load a bundled scene and make its map small."""
    whole = wc.load_scene(name)
    return whole.model_copy(update={"map": whole.map.model_copy(update={"resolution": resolution})})


def rough_pool(
    slope: float, depth: float, resolution: tuple[int, int] = (64, 64), direction: Any = (0.0, 0.0, -1.0), **method: Any
) -> wc.Scene:
    """Make the pool at another rms slope of its waves and another depth, by default under a vertical sun."""
    table = tables(bundled("pool", resolution))
    waves = table["water"]["waves"]
    rms = np.sqrt(sum(one["amplitude"] ** 2 * np.dot(one["wavevector"], one["wavevector"]) / 2.0 for one in waves))
    table["water"]["waves"] = [{**one, "amplitude": float(one["amplitude"] * slope / rms)} for one in waves]
    table["water"]["level"] = depth
    return wc.Scene(**{**table, "sun": {"direction": direction}, "method": method})


def tables(of: wc.Scene) -> dict[str, Any]:
    """Give a scene as the tables of its file, to be changed and made a scene again."""
    return of.model_dump(exclude_unset=True, exclude_none=True)


def render(what: wc.Scene, method: str, device: str, time: float = 0.0, threads: int = 1) -> wc.Result:
    """Render by the front door; one thread, since the maps are too small to share out."""
    return wc.render(what, method=method, device=device, threads=threads, time=time)


def save_heights(folder: Path, name: str, z: np.ndarray, origin: tuple[float, float], size: tuple[float, float]) -> Any:
    """Write a height map as NPY, row 0 at the origin, and give the table that names it."""
    path = folder / f"{name}.npy"
    np.save(path, z)
    return {"file": str(path), "origin": origin, "size": size}


def sample_points(
    shape: tuple[int, int], origin: tuple[float, float], size: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Give x and y of the samples of a height map of (rows, columns), broadcastable to its shape."""
    rows, columns = shape
    x = origin[0] + (np.arange(columns) + 0.5) * size[0] / columns
    y = origin[1] + (np.arange(rows) + 0.5) * size[1] / rows
    return x[None, :], y[:, None]


def sum_of_waves(waves: Any, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Add up waves at points, at time 0."""
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    for one in waves:
        kx, ky = one["wavevector"]
        total += one["amplitude"] * np.sin(kx * x + ky * y + one.get("phase", 0.0))
    return total


def save_mesh(folder: Path, name: str, vertices: Any, faces: Any) -> str:
    """Write polygons as OBJ."""
    path = folder / f"{name}.obj"
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in vertices]
    lines += ["f " + " ".join(str(i + 1) for i in face) + "\n" for face in faces]
    path.write_text("".join(lines))
    return str(path)


def save_quad(folder: Path, half: float = 30.0, slope: tuple[float, float] = (0.0, 0.0), base: float = 0.0) -> str:
    """Write a large quad in the plane z = base + slope . (x, y), as a mesh."""
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    vertices = [(x, y, base + slope[0] * x + slope[1] * y) for x, y in corners]
    return save_mesh(folder, "quad", vertices, [(0, 1, 2, 3)])


def save_box(folder: Path) -> str:
    """Write a cube with sides of 1 that stands on z = 0 above the origin, as a mesh."""
    vertices = [(x, y, z) for z in (0.0, 1.0) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    return save_mesh(folder, "box", vertices, faces)


def relative_l2(one: np.ndarray, other: np.ndarray) -> float:
    """Give the root mean square difference over the mean of ``other``."""
    difference = one.astype(np.float64) - other
    return float(np.sqrt(np.mean(difference**2)) / np.mean(other, dtype=np.float64))


def refracted(direction: Any) -> np.ndarray:
    """Give the horizontal way by unit depth of light under flat water."""
    x, y, _ = direction
    return np.array([x, y]) / IOR / np.sqrt(1.0 - (x * x + y * y) / IOR**2)


def assert_adds_up(result: wc.Result) -> None:
    """Every entry is there, none is negative, and they add up; the map's sum is what was received, dry or invented."""
    energy = result.energy
    emitted = np.asarray(energy.emitted)
    assert (emitted > 0.0).all()
    np.testing.assert_allclose(sum(np.asarray(energy[name]) for name in LOSSES), emitted, rtol=LEDGER)
    assert energy.unaccounted < LEDGER
    for name, value in energy.items():
        assert name == "invented" or np.min(value) >= -LEDGER * emitted.max(), name
    assert np.max(energy.dropped) == 0.0
    channels = result.caustic_map.shape[2:]
    pixel_area = np.prod(result.scene.map.size) / np.prod(result.scene.map.resolution)
    landed = result.caustic_map.reshape(-1, *channels).sum(axis=0, dtype=np.float64) * pixel_area
    np.testing.assert_allclose(landed, np.add(energy.received, energy.dry) + energy.invented, rtol=LEDGER)
