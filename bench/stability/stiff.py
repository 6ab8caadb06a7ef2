"""Error and stability of simulated water against its step of time: ``python bench/stability/stiff.py [-o DIR]``.

A drop three cells wide in a basin of cells so small that surface tension makes the equation stiff. Each kind is judged
by its own equation, solved exactly in time by its modes in NumPy: what is seen is the error of time alone. The explicit
integrator is also run past the limit at which a scene is refused, to see where it turns unstable. Writes
``stiff.json`` and ``stiff.png``.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import platform
from pathlib import Path

import numpy as np
import warp as wp

import warp_caustics as wc
from warp_caustics.files import whole_file
from warp_caustics.simulation import Basin, SimulatedWater, make_basin
from warp_caustics.simulation.basin import SAFE_SHARE
from warp_caustics.simulation.drops import drop_profiles
from warp_caustics.simulation.passes import implicit_iterations
from warp_caustics.water import GRAVITY

CELLS, SIDE, DEPTH = 32, 0.064, 0.02
"""Cells along each side of the basin, its side and its depth [m]: cells of 2 mm, in which tension rules the limit."""

DROP = {"position": (0.025, 0.036), "radius": 0.006, "amplitude": 0.001}
TIME = 0.8
"""When the error is taken [s]: about 1000 explicit steps, and many periods of the drop's waves."""

EXPLICIT_COUNTS = (16000, 8000, 4000, 2000, 1400, 1200, 1100, 1050)
IMPLICIT_COUNTS = (8000, 4000, 2000, 1000, 500, 200, 100, 50, 20, 10, 5, 2, 1)
SPECTRAL_COUNTS = (16000, 1000, 100, 10, 1)
"""Steps in which each gets there."""

GROWTH_SHARES = (0.1, 0.3, 0.7, 0.9, 0.99, 0.999, 1.001, 1.003, 1.01, 1.03, 1.1)
IMPLICIT_GROWTH_SHARES = (0.1, 1.0, 10.0, 100.0, 1000.0)
"""Steps, as a share of the explicit limit, with which growth is looked for."""

GROWTH_STEPS, LONG_STEPS = 300, 20
"""Steps that growth gets; fewer for implicit steps of thousands of iterations."""

DRIFT_STEPS = 100_000
LIMIT_CELLS = np.geomspace(1e-4, 0.1, 61)
"""Sides of cells for which limits are drawn [m]."""


def basin(**settings: object) -> Basin:
    """Make the basin, with settings of its simulation."""
    simulation = {"resolution": (CELLS, CELLS), "origin": (0.0, 0.0), "size": (SIDE, SIDE), "depth": DEPTH,
                  "drops": [DROP], **settings}  # fmt: skip
    scene = wc.Scene(
        water={"level": DEPTH, "simulation": simulation}, receiver={"plane": 0.0}, sun={"direction": (0, 0, -1)},
        medium={"ior": 1.333}, map={"origin": (0, 0), "size": (SIDE, SIDE), "resolution": (8, 8)},
    )  # fmt: skip
    return make_basin(scene, DEPTH, np.zeros(2), np.full(2, SIDE))


def frequencies(of: Basin) -> np.ndarray:
    """Exact angular frequencies of a basin's modes ``[rows, columns]``: of its water, or of its cells."""
    k = [np.pi * np.arange(n) / side for n, side in ((of.columns, of.size[0]), (of.rows, of.size[1]))]
    if of.spectral:
        q = np.hypot(k[0][None, :], k[1][:, None])
        return np.sqrt((GRAVITY * q + of.tension * q**3) * np.tanh(q * of.depth))
    along, across = ((2.0 * np.sin(0.5 * k[i] * of.cell[i]) / of.cell[i]) ** 2 for i in (0, 1))
    square = along[None, :] + across[:, None]
    return np.sqrt(GRAVITY * of.depth * square + of.tension * of.depth * square**2)


def exact(of: Basin, time: float) -> np.ndarray:
    """Surface of a basin's drops at a time, by plain sums over its modes."""
    rows, columns = drop_profiles(of)
    waves = [np.cos(np.pi * np.outer(np.arange(n), np.arange(n) + 0.5) / n) for n in (of.rows, of.columns)]
    factors = [(p @ w.T / (w**2).sum(axis=1)).T for p, w in zip((rows, columns), waves, strict=True)]
    modes = factors[0] @ factors[1].T * np.cos(frequencies(of) * time)
    return waves[0].T @ modes @ waves[1]


def error_at(of: Basin, count: int, device: str | None) -> float:
    """Relative L2 error at TIME when it is reached in so many steps."""
    of = dataclasses.replace(of, step=TIME / count)
    water = SimulatedWater(of, device or "cpu")
    water.advance(TIME)
    expected = exact(of, TIME)
    with np.errstate(all="ignore"):
        return float(np.linalg.norm(water.motion.surface.numpy() - expected) / np.linalg.norm(expected))


def growth(of: Basin, step: float, steps: int, device: str | None) -> float:
    """Largest displacement of all times up to so many steps, over that of the start: rough, or the drop in modes."""
    water = SimulatedWater(dataclasses.replace(of, step=step), device or "cpu")
    water.advance(0.0)
    if not of.spectral:
        water.motion.height.assign(np.random.default_rng(1).choice([-1e-3, 1e-3], size=(of.rows, of.columns)))
    largest = 0.0
    with np.errstate(all="ignore"):
        for part in np.linspace(0, steps, 11).astype(int)[1:]:
            water.advance(part * step)
            largest = max(largest, float(np.nan_to_num(np.abs(water.motion.surface.numpy()), nan=np.inf).max()))
    return largest / 1e-3  # the height of both starts


def drift(of: Basin, device: str | None) -> float:
    """Relative drift of the energy in 1e5 steps: of its mean in the last tenth against the first."""
    water = SimulatedWater(of, device or "cpu")
    at = np.concatenate([np.linspace(0, 0.1, 21), np.linspace(0.9, 1.0, 21)])
    energies = []
    for share in at:
        water.advance(round(share * DRIFT_STEPS) * of.step)
        energies.append(energy(of, water.motion.surface.numpy(), water.motion.velocity.numpy()))
    return float(abs(np.mean(energies[21:]) / np.mean(energies[:21]) - 1.0))


def energy(of: Basin, height: np.ndarray, velocity: np.ndarray) -> float:
    """Sum over modes of v^2 + w^2 h^2."""
    waves = [np.cos(np.pi * np.outer(np.arange(n), np.arange(n) + 0.5) / n) for n in (of.rows, of.columns)]
    norms = np.outer(*((w**2).sum(axis=1) for w in waves))
    h, v = (waves[0] @ field @ waves[1].T for field in (height, velocity))
    return float(((v**2 + (frequencies(of) * h) ** 2) / norms).sum())


def measure(device: str | None) -> dict[str, object]:
    """Run all sweeps."""
    explicit, implicit = basin(kind="grid"), basin(kind="grid", integrator="implicit")
    spectral, limit = basin(kind="spectral"), explicit.step / SAFE_SHARE
    kinds = (("spectral", spectral, SPECTRAL_COUNTS), ("explicit", explicit, EXPLICIT_COUNTS),
             ("implicit", implicit, IMPLICIT_COUNTS))  # fmt: skip
    errors, grows = [], []
    for name, of, counts in kinds:
        for count in counts:
            stepped = dataclasses.replace(of, step=TIME / count)
            errors.append({
                "kind": name, "step": TIME / count, "over_limit": TIME / count / limit, "steps": count,
                "error": error_at(of, count, device),
                "iterations": implicit_iterations(stepped) if name == "implicit" else None,
            })  # fmt: skip
            print(f"{name:<9} step {TIME / count:9.3g} s, {TIME / count / limit:8.3g} of the limit: "
                  f"error {errors[-1]['error']:.2e}", flush=True)  # fmt: skip
    sweeps = (("spectral", spectral, IMPLICIT_GROWTH_SHARES), ("explicit", explicit, GROWTH_SHARES),
              ("implicit", implicit, IMPLICIT_GROWTH_SHARES))  # fmt: skip
    for name, of, shares in sweeps:
        for share in shares:
            steps = LONG_STEPS if share > 10.0 else GROWTH_STEPS
            grows.append({"kind": name, "over_limit": share, "steps": steps,
                          "growth": growth(of, share * limit, steps, device)})  # fmt: skip
            print(f"{name:<9} {share:8.3g} of the limit: grows {grows[-1]['growth']:.3g} times", flush=True)
    small = {"kind": "grid", "resolution": (6, 5), "drops": [{**DROP, "radius": 0.015}]}
    drifts = {name: drift(dataclasses.replace(of, step=0.25 * of.step), device)
              for name, of in (("explicit", basin(**small)),
                               ("implicit", basin(**small, integrator="implicit")))}  # fmt: skip
    print(f"energy drift in {DRIFT_STEPS:,} steps: {drifts}", flush=True)
    return {
        "schema": 1, "warp_caustics": wc.__version__, "warp": wp.__version__, "machine": platform.machine(),
        "device": device or "cpu", "cell": explicit.cell[0], "depth": DEPTH, "time": TIME, "explicit_limit": limit,
        "errors": errors, "growth": grows, "energy_drift_in_1e5_steps": drifts,
        "limits": [{"cell": float(c), "limit": limit_of(float(c), True), "gravity_alone": limit_of(float(c), False)}
                   for c in LIMIT_CELLS],
    }  # fmt: skip


def limit_of(cell: float, tension: bool) -> float:
    """Longest explicit step for cells of a side [s]."""
    settings = {} if tension else {"surface_tension": 0.0}
    side = 8 * cell
    of = basin(kind="grid", resolution=(8, 8), size=(side, side), drops=[], **settings)
    return of.step / SAFE_SHARE


def draw(data: dict, path: Path) -> None:
    """Draw error, growth and limit, side by side."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15.0, 4.8), layout="constrained")
    colours = {"spectral": "tab:green", "explicit": "tab:red", "implicit": "tab:blue"}
    for name, colour in colours.items():
        rows = [row for row in data["errors"] if row["kind"] == name]
        left.loglog([r["over_limit"] for r in rows], [r["error"] for r in rows], "o-", color=colour, ms=4, label=name)
        rows = [row for row in data["growth"] if row["kind"] == name]
        shown = [min(r["growth"], 1e12) for r in rows]  # past it, only a number that has left the picture
        middle.loglog([r["over_limit"] for r in rows], shown, "o-", color=colour, ms=4, label=name)
    for axis in (left, middle):
        axis.axvline(1.0, color="0.5", ls="--", lw=1)
        axis.set_xlabel("step / longest stable explicit step")
        axis.grid(alpha=0.3)
    slope = np.array([0.06, 0.6])
    left.loglog(slope, 0.02 * slope**2, color="0.4", lw=1)
    left.annotate("step²", (0.15, 2e-5), color="0.3")
    left.set_ylabel("relative L2 error of the surface")
    left.set_title(f"error after {data['time']:g} s, by each one's own equation", fontsize=10)
    left.legend()
    middle.axhline(1.0, color="0.7", lw=1)
    middle.set_ylim(0.1, 3e12)
    middle.set_ylabel("largest displacement / that of the start")
    middle.set_title(f"growth in {GROWTH_STEPS} steps ({LONG_STEPS} past 10 times the limit)", fontsize=10)
    middle.legend(loc="center right")
    middle.annotate("refused", (1.3, 1e10), color="0.3")
    cells = [row["cell"] for row in data["limits"]]
    right.loglog(
        cells, [row["limit"] for row in data["limits"]], color=colours["explicit"], label="gravity and tension"
    )
    right.loglog(cells, [row["gravity_alone"] for row in data["limits"]], color="0.5", ls="--", label="gravity alone")
    right.set_xlabel("side of a cell [m]")
    right.set_ylabel("longest stable explicit step [s]")
    right.set_title(f"stiffness: cell² where tension rules ({data['depth']:g} m deep)", fontsize=10)
    right.grid(alpha=0.3)
    right.legend()
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")
    plt.close(figure)


def main() -> None:
    """Measure, write, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out"), help="folder for stiff.json and stiff.png")
    parser.add_argument("--device", default=None, help="cpu, cuda:0")
    arguments = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    data = measure(arguments.device)
    arguments.output.mkdir(parents=True, exist_ok=True)
    with whole_file(arguments.output / "stiff.json") as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n")
    draw(data, arguments.output / "stiff.png")
    print(f"wrote {arguments.output / 'stiff.json'} and {arguments.output / 'stiff.png'}")


if __name__ == "__main__":
    main()
