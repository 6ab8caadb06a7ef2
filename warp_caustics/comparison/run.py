"""The comparison: plan everything, make the reference, measure each setting, and draw the front."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from statistics import median
from typing import TYPE_CHECKING

from warp_caustics.comparison import machine
from warp_caustics.comparison.flip import why_not
from warp_caustics.comparison.jittered import jittered_slope
from warp_caustics.comparison.published import PUBLISHED, PublishedSpeed
from warp_caustics.comparison.record import Comparison, Machine, Published, ReferenceRecord, ScreenRecord
from warp_caustics.comparison.rows import Truth, measured_row, slopes_of, with_fronts
from warp_caustics.comparison.settings import chosen_methods, with_settings
from warp_caustics.comparison.trials import plan_trials
from warp_caustics.errors import InputError
from warp_caustics.scene import GatherSettings, Scene, load_scene

FINER = 2
"""Pixels of the map that the eye's reference is carried from, along a side of a pixel of the scene's own."""

if TYPE_CHECKING:
    from warp_caustics.comparison.screen import CarriedReference
    from warp_caustics.reference import Reference

Tell = Callable[[int, int, str], None]
"""Is told, before each step: its number from 0, how many there are, and what it is."""


def compare(
    scene: Scene | str | os.PathLike[str],
    methods: Sequence[str] | str | None = None,
    device: str | None = None,
    threads: int | None = None,
    time: float = 0.0,
    tell: Tell | None = None,
) -> Comparison:
    """Measure the error, run time and memory of methods on a scene, each at several settings, in one run.

    Parameters
    ----------
    scene : Scene, str or path
        A scene, the name of a bundled one, or a file.
    methods : sequence of str, optional
        By name; all that can be compared when left out.
    device, threads
        As for :func:`~warp_caustics.make_plan`.
    time : float
        On the water's clock [s], of all frames.
    tell : callable, optional
        Is told before each step its number from 0, how many there are, and what it is.

    Returns
    -------
    Comparison
        Its ``rows``, ``front`` and ``slopes``; ``save(folder)`` writes JSON and picture. A setting that cannot serve
        the scene is a row with the reason.

    Raises
    ------
    InputError
        If a method is not known, if no setting can serve the scene, or as :func:`~warp_caustics.make_plan`.
    """
    from warp_caustics.assets import load_assets
    from warp_caustics.device import resolve_device, resolve_threads
    from warp_caustics.facts import with_placed_water
    from warp_caustics.reference import make_reference

    tell = tell or (lambda number, count, what: None)
    names = chosen_methods(methods)
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    # One water for all settings and resolutions, so that they can be compared.
    scene = with_placed_water(scene, load_assets(scene))
    device = resolve_device(device)
    lanes = resolve_threads(threads, device)
    trials = plan_trials(scene, names, device, threads)
    published = [speed for speed in PUBLISHED if speed.gather] if "gather" in names else []
    steps = 1 + len(trials) + len(published) + 1

    tell(0, steps, "reference")
    reference = make_reference(scene, time, device=device, threads=threads)
    carried = None
    if any(trial.looks for trial in trials):
        tell(0, steps, "reference for the eye")
        fine = scene.at_resolution(*(FINER * side for side in scene.map.resolution))
        carried = _carried(fine, make_reference(fine, time, device=device, threads=threads), device)
    truth = Truth(reference, carried)
    rows = []
    for number, trial in enumerate(trials, 1):
        tell(number, steps, trial.label)
        rows.append(measured_row(trial, truth, device, threads, time))
    ours = {}
    for number, speed in enumerate(published, 1 + len(trials)):
        tell(number, steps, f"gather, {speed.work}")
        ours[speed] = _ours(speed, scene, device, threads, time)
    tell(steps - 1, steps, "jittered points")
    jittered = jittered_slope(scene, time, reference, device, threads)
    return Comparison(
        created=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        commit=machine.commit(),
        versions=machine.versions(),
        machine=Machine(
            cpu=machine.cpu_name(), cores=machine.cores(), system=f"{platform.system()} {platform.machine()}",
            device=device, device_name=machine.device_name(device), threads=lanes,
        ),
        scene_name=scene.name,
        scene=scene.to_toml(),
        time=time,
        resolution=scene.map.resolution,
        reference=ReferenceRecord(
            error_bar=reference.error_bar, samples=reference.samples, seconds=reference.seconds,
            cached=reference.cached,
        ),
        screen=_screen_record(scene, truth),
        rows=with_fronts(rows, truth),
        slopes=[*slopes_of(rows, reference.error_bar), jittered],
        published=[_published(speed, ours.get(speed)) for speed in PUBLISHED],
        flip_skipped=why_not(),
    )  # fmt: skip


def _carried(scene: Scene, reference: Reference, device: str) -> CarriedReference | None:
    if scene.camera is None:
        return None
    from warp_caustics.assets import load_assets
    from warp_caustics.comparison.screen import CarriedReference

    return CarriedReference(scene, load_assets(scene), scene.camera, reference, device)


def _screen_record(scene: Scene, truth: Truth) -> ScreenRecord | None:
    if scene.camera is None or truth.carried is None:
        return None
    return ScreenRecord(
        resolution=scene.camera.resolution,
        pixels=len(truth.carried.irradiance),
        error_bar=truth.carried.error_bar,
    )


def _ours(speed: PublishedSpeed, scene: Scene, device: str, threads: int | None, time: float) -> float | None:
    """Time our gather at a publication's work, two passes over a plane [ms]; None where the scene has none."""
    from warp_caustics.comparison.measure import measure

    if speed.gather is None or scene.receiver.plane is None:
        return None
    columns, rows, n = speed.gather
    same_work = with_settings(scene.at_resolution(columns, rows), "gather", GatherSettings(n=n, form="two_pass"))
    try:
        return 1e3 * median(measure(same_work, device, threads, time).seconds)
    except InputError:
        return None


def _published(speed: PublishedSpeed, ours: float | None) -> Published:
    low, high = speed.milliseconds
    return Published(
        system=speed.system, hardware=speed.hardware, work=speed.work, milliseconds_low=low, milliseconds_high=high,
        source=speed.source, ours_milliseconds=ours,
    )  # fmt: skip
