"""What the cascades' choices cost and do: ``python bench/cascades.py -o FOLDER [--quick]``.

Four tables in markdown: how G-buffers are stored (bytes, time, the error that it puts into the landing), passes by
cascade with and without the terrain seen by the sun, dispersion three ways by resolution, and a flight across the
border of two cascades, hard and blended, by flux and by the published constant. Times are of the fastest of some warm
frames, each pass by itself. ``--quick`` takes a minute on two cores.
"""

import argparse
import functools
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
import warp as wp
from flight import Flight, fly

import warp_caustics as wc
from warp_caustics.assets import load_assets
from warp_caustics.comparison.screen import CarriedReference
from warp_caustics.kernels.cascade_photon import CascadeSpec, make_follow, slope_of
from warp_caustics.kernels.light_g_buffer import POSITION_STORAGE, make_texel_position
from warp_caustics.kernels.packing import NORMAL_STORAGE, UNPACK
from warp_caustics.kernels.photon import LANDED, SunSample
from warp_caustics.kernels.photon import Scene as DeviceScene
from warp_caustics.kernels.surface import HEIGHT_AND_SLOPE
from warp_caustics.kernels.views import View
from warp_caustics.metrics import relative_l2
from warp_caustics.sequence import Step
from warp_caustics.sequence_recording import side_by_side

FRAMES = 5
"""Warm frames at most, of which the fastest counts: the one that was disturbed least."""

FINER = 2
"""Sides of the reference's map over those of the scene's, in the table of dispersion."""

ENOUGH_SECONDS = 3.0
"""No further frame once they have taken this long: slow ones are hardly disturbed."""

IORS = (1.331, 1.334, 1.339)
"""Of red, green and blue: fresh water at 650, 550 and 450 nm, to the digits that a scene file shows."""

STORAGE = [(p, n) for p in ("float3", "depth") for n in ("float3", "octahedral", "angles")]


@dataclass(frozen=True)
class Size:
    """How much is measured."""

    texels: int
    camera: tuple[int, int]
    map: int
    resolutions: tuple[int, ...]
    flight: Flight


WHOLE = Size(1024, (1280, 720), 512, (512, 1024, 2048, 4096), Flight(0.0, 100, (640, 360), 1024))
QUICK = Size(192, (160, 90), 64, (64, 128), Flight(0.0, 25, (96, 54), 96))


def cascaded(name: str, size: Size, medium: dict[str, Any] | None = None, **settings: Any) -> wc.Scene:
    """Give a bundled scene for this method."""
    table = wc.load_scene(name).model_dump(exclude_unset=True, exclude_none=True)
    table["camera"]["resolution"] = size.camera
    table["map"]["resolution"] = (size.map, size.map)
    table["medium"] |= medium or {}
    table["method"] = {"name": "cascaded", "cascaded": {"resolution": size.texels, **settings}}
    return wc.Scene(**table)


def times(renderer: wc.Renderer) -> dict[tuple[str, str], float]:
    """Milliseconds of each pass by cascade: commands run one by one, each waited for."""
    # On one thread each step is one lane.
    lanes, best = [lane for stage in renderer._recording.stages for lane in stage], {}
    steps = [step for stage in renderer.plan.program.stages for group in side_by_side(stage) for step in group]
    renderer.render(0.0)
    begin = perf_counter()
    for _ in range(FRAMES):
        if best and perf_counter() - begin > ENOUGH_SECONDS:
            break
        frame: dict[tuple[str, str], float] = {}
        for step, lane in zip(steps, lanes, strict=True):
            wp.synchronize()
            start = perf_counter()
            for command in lane:
                command.launch()
            wp.synchronize()
            key = part_of(step), step.name.split(".")[-1].replace("rasterize cascade", "rasterize ")
            frame[key] = frame.get(key, 0.0) + 1e3 * (perf_counter() - start)
        best = {key: min(ms, best.get(key, np.inf)) for key, ms in frame.items()}
    return best


def part_of(step: Any) -> str:
    """Say which cascade a step belongs to, or that it is the camera's."""
    names = [*step.bind.values()] if isinstance(step, Step) else [step.buffer]
    found = {name.split(".")[0] for name in names if name and name.startswith("cascade")}
    return found.pop() if len(found) == 1 and step.name != "composite" else "camera"


def bytes_of(plan: Any, prefix: str) -> int:
    """Bytes of the buffers whose names begin so."""
    return sum(buffer.bytes for buffer in plan.buffers if buffer.name.startswith(prefix))


@functools.cache
def landing_kernel(spec: CascadeSpec, analytic: bool) -> wp.Kernel:
    """Kernel that lands each texel's photon: by what its G-buffer holds, or by the surface itself at that place."""
    follow, position_at, unpack = make_follow(spec), make_texel_position(spec.positions), UNPACK[spec.normals]
    position_type, normal_type = POSITION_STORAGE[spec.positions], NORMAL_STORAGE[spec.normals]
    water_at = HEIGHT_AND_SLOPE[spec.scene.water]

    @wp.kernel(module="unique", enable_backward=False)
    def land_texels(
        scene: DeviceScene,
        suns: wp.array[SunSample],
        view: wp.array[View],
        position: wp.array2d[position_type],
        normal: wp.array2d[normal_type],
        landing_out: wp.array2d[wp.vec3],
    ):
        row, column = wp.tid()
        sun = suns[0].direction
        origin = position_at(view[0], position, column, row)
        slope = slope_of(unpack(normal[row, column]))
        if wp.static(analytic):
            for _ in range(8):  # along the light to the surface itself: its slope is far from the light's
                z = water_at(scene.water.surface, origin[0], origin[1])
                origin += (z[0] - origin[2]) / sun[2] * sun
            slope = wp.vec2(z[1], z[2])
        result = follow(scene, sun, origin, slope, origin)
        landing_out[row, column] = wp.vec3(wp.nan, wp.nan, wp.nan)
        if result.state == LANDED:
            landing_out[row, column] = origin + result.distance * result.direction

    return land_texels


def landings(renderer: wc.Renderer, positions: str, normals: str, analytic: bool = False) -> np.ndarray:
    """Where the photons of the widest cascade land [m]."""
    facts, arrays, (state,) = renderer.plan.facts, renderer._recording.arrays, renderer._states
    spec = CascadeSpec(replace(facts.spec, self_shadow=False), positions=positions, normals=normals)
    last = f"cascade{facts.scene.method.cascaded.count - 1}"
    shape = arrays[f"{last}.water_position"].shape
    landing = wp.empty(shape, dtype=wp.vec3, device=renderer.plan.device)
    inputs = [state.scene, state.suns, *(arrays[f"{last}.{n}"] for n in ("view", "water_position", "water_normal"))]
    wp.launch(landing_kernel(spec, analytic), dim=shape, inputs=inputs, outputs=[landing], device=renderer.plan.device)
    return landing.numpy().astype(np.float64)


def storage_table(size: Size, device: str | None) -> Iterator[str]:
    """Each form of storage: bytes, time, error of the landing."""
    yield "## How G-buffers are stored (`pool`, its widest cascade)\n"
    yield "The first error is against three floats of both, so it is the storage's own; the second against the surface"
    yield "itself, so it has the chords of the lattice and the interpolation of its normals as well.\n"
    yield (
        "| positions | normals | bytes a texel | store, ms | photons, ms | storage error, mm: rms | largest "
        "| from the surface, mm: rms |\n" + "|---" * 8 + "|"
    )
    whole = exact = None
    for positions, normals in STORAGE:
        scene = cascaded("pool", size, positions=positions, normals=normals)
        renderer = wc.Renderer(scene, "cascaded", device, threads=1)
        took = times(renderer)
        found = landings(renderer, positions, normals)
        if whole is None:
            whole, exact = found, landings(renderer, positions, normals, analytic=True)
        own, off = (1e3 * np.linalg.norm(found - truth, axis=-1) for truth in (whole, exact))
        last = f"cascade{renderer.plan.facts.scene.method.cascaded.count - 1}"
        texel = sum(bytes_of(renderer.plan, f"{last}.water_{name}") for name in ("position", "normal")) / size.texels**2
        yield (
            f"| {positions} | {normals} | {texel:.0f} | {took[last, 'store water']:.2f} | {took[last, 'photons']:.2f} "
            f"| {rms(own):.2g} | {np.nanmax(own):.2g} | {rms(off):.2g} |"
        )


def rms(values: np.ndarray) -> float:
    """Root mean square of those that are there."""
    return float(np.sqrt(np.nanmean(values**2)))


def pass_table(size: Size, device: str | None) -> Iterator[str]:
    """Each pass by cascade, with and without the terrain as the sun sees it."""
    yield "\n## Passes, ms by cascade (`beach`)\n"
    for projection in ("exact", "backlund"):
        renderer = wc.Renderer(cascaded("beach", size, projection=projection), "cascaded", device, threads=1)
        took, count = times(renderer), renderer.plan.facts.scene.method.cascaded.count
        columns = [f"cascade{i}" for i in range(count)] + ["camera"]
        with_ground = "with" if projection == "backlund" else "without"
        yield f"\nprojection = `{projection}`, {with_ground} the terrain's depth pass\n"
        yield "| pass | " + " | ".join(columns) + " |\n|---" + "|---" * len(columns) + "|"
        for name in dict.fromkeys(name for _, name in took):
            cells = (f"{took[c, name]:.2f}" if (c, name) in took else "" for c in columns)
            yield f"| {name} | " + " | ".join(cells) + " |"
        totals = (sum(ms for (part, _), ms in took.items() if part == c) for c in columns)
        yield "| **all** | " + " | ".join(f"{ms:.2f}" for ms in totals) + " |"
        own = [bytes_of(renderer.plan, f"{c}.") for c in columns[:-1]]
        cells = [f"{b:,}" for b in (*own, renderer.plan.bytes - sum(own))]
        yield "| **bytes** | " + " | ".join(cells) + " |"


def dispersion_table(size: Size, device: str | None) -> Iterator[str]:
    """Dispersion three ways: error in eye pixels against the reference, time, bytes."""
    yield "\n## Dispersion (`pool`, indices of fresh water, ten times as far apart)\n"
    yield "Errors are relative L2 in eye pixels, against the converged reference carried to them.\n"
    medium = {"ior": IORS, "dispersion_strength": 10.0}
    traced = cascaded("pool", size, {**medium, "dispersion": "traced"})
    assert traced.camera is not None
    # From a finer map, whose pixels blur less than the finest light view.
    fine = traced.at_resolution(FINER * size.map, FINER * size.map)
    truth = CarriedReference(
        fine, load_assets(fine), traced.camera, wc.make_reference(fine, device=device), device or "cpu"
    )
    yield f"That has an error bar of {truth.error_bar:.1%}: what differs by less is a tie.\n"
    yield (
        "| texels | how | error | ms a frame | photons, ms by cascade | bytes a cascade | bytes |\n" + "|---" * 7 + "|"
    )
    for texels in size.resolutions:
        for how in ("each", "shared", "post"):
            settings = {} if how == "post" else {"dispersion_photons": how}
            dispersion = {**medium, "dispersion": "post" if how == "post" else "traced"}
            scene = cascaded("pool", replace(size, texels=texels), dispersion, **settings)
            renderer = wc.Renderer(scene, "cascaded", device, threads=1)
            took = times(renderer)
            seen = renderer.result().screen_map
            count = renderer.plan.facts.scene.method.cascaded.count
            photons = ", ".join(f"{took[f'cascade{i}', 'photons']:.1f}" for i in range(count))
            yield (
                f"| {texels} | {how} | {relative_l2(truth.judged(seen), truth.irradiance):.2%} "
                f"| {sum(took.values()):.1f} | {photons} | {bytes_of(renderer.plan, 'cascade0.'):,} "
                f"| {renderer.plan.bytes:,} |"
            )


def flight_table(size: Size, device: str | None) -> Iterator[str]:
    """A patch of the floor that passes from one cascade to the next."""
    flight = size.flight
    yield f"\n## A flight of {flight.frames} frames across the border of two cascades\n"
    yield "Brightness of a fixed patch of the floor: how much it changes over the flight, and from frame to frame.\n"
    yield "| brightness | border | over the flight | largest step |\n|---|---|---|---|"
    for brightness in ("flux", "published"):
        for border, blend in (("hard switch", 0.0), ("blend", 0.4)):
            found, _ = fly(replace(flight, blend=blend, brightness=brightness), device or "cpu")
            step = np.abs(np.diff(found)).max() / found.mean()
            yield f"| {brightness} | {border} | {found.max() / found.min() - 1.0:.3%} | {step:.3%} |"


def main() -> None:
    """Print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/cascades"), help="folder of the tables")
    parser.add_argument("--quick", action="store_true", help="small pictures and light views: a minute on two cores")
    parser.add_argument("--device", default=None, help="cpu, cuda:0; the best one present if not given")
    parser.add_argument("--resolutions", type=int, nargs="*", help="texels of the table of dispersion")
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    size = QUICK if chosen.quick else WHOLE
    if chosen.resolutions:
        size = replace(size, resolutions=tuple(chosen.resolutions))
    lines = [f"# Cascades, {size.texels} texels a side, {size.camera[0]} x {size.camera[1]} pixels\n"]
    for table in (storage_table, pass_table, dispersion_table, flight_table):
        for line in table(size, chosen.device):
            print(line, flush=True)
            lines.append(line)
    chosen.output.mkdir(parents=True, exist_ok=True)
    (chosen.output / "cascades.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
