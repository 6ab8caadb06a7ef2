"""What follows from a scene, derived once: the specification of its kernels, and the bounds of its light."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from .dispersion import CHANNELS, channel_scene
from .kernels.spec import Spec
from .receiver import SHALLOWEST, Bounds, check_covered, receiver_bounds, receiver_kind, rest_depth
from .simulation.basin import Basin, make_basin
from .simulation.sea import Sea, make_sea
from .specify import Light, Reason, reasons, specify
from .sun import MOST_DIRECTIONS, disk_count, disk_directions
from .water import amplitude_bound, extreme_slopes
from .window import Reach, deviation_bounds, refraction_reach

if TYPE_CHECKING:
    from .assets import Assets
    from .scene import Scene


SPARE_WAY = 4.0
"""Times the longest way that rays to a mesh are followed; it costs nothing, and spares a proof for each corner."""


@dataclass(frozen=True)
class Facts:
    """All that a plan needs to know of a scene; ``basin`` is water that is made before each frame.

    ``device`` is where the frame is made: forms of a sum that are the fastest on one are not on the other.
    Heights are relative to the water's level, positions to the map's origin, in metres and float64.
    """

    scene: Scene
    assets: Assets
    spec: Spec
    ior: float
    attenuation: tuple[float, float, float]
    irradiance: tuple[float, ...]
    suns: np.ndarray
    rest_shifts: np.ndarray
    reaches: tuple[Reach, ...]
    rest_depth: float
    amplitude: float
    slope: float
    ground: Bounds
    pixel: np.ndarray
    deviation: tuple[np.ndarray, np.ndarray]
    backlund_deviation: tuple[np.ndarray, np.ndarray]
    longest_way: float
    reasons: tuple[Reason, ...]
    basin: Basin | Sea | None = None
    warnings: tuple[str, ...] = field(default=())
    device: str = "cpu"

    @property
    def sun_share(self) -> float:
        """Irradiance of one direction of the sun, where the whole disk gives 1 on a plane that faces its middle."""
        return float(1.0 / (self.suns @ self.scene.sun.unit_direction).sum())

    @property
    def longest_ray(self) -> float:
        """Longest way to a mesh [m]: down through the water, or up to the top of what shades it from the lowest sun."""
        down = self.longest_way + self.ground.highest - self.ground.lowest
        up = (max(self.ground.highest, 0.0) + self.amplitude) / -float(self.suns[:, 2].max())
        return SPARE_WAY * max(down, up)

    @property
    def water_border(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper corner of water that ends, from the map's origin [m]; None for water without a border."""
        water = self.assets.water if self.basin is None else None if self.basin.periodic else self.basin
        if water is None:
            return None
        low = np.subtract(water.origin, self.scene.map.origin)
        return low, low + np.asarray(water.size)

    @property
    def waves(self) -> int:
        """Count of the water's waves."""
        return len(self.scene.waves)


def gather_facts(scene: Scene, assets: Assets) -> Facts:
    """Derive the facts of a scene.

    Raises
    ------
    InputError
        If the map reaches past the terrain, or the water's simulation or spectrum cannot be had.
    """
    check_covered(scene, assets)
    ior, warnings = scene.medium.green_ior, []
    if len(set(scene.medium.ior_by_channel)) > 1 and scene.medium.dispersion == "none":
        warnings.append(f"medium.ior: given by channel without dispersion, so green's {ior:g} serves for all")
    pixel = np.asarray(scene.map.size, dtype=np.float64) / np.asarray(scene.map.resolution)
    slopes = extreme_slopes(scene, assets)
    amplitude = amplitude_bound(scene, assets)
    depth = rest_depth(scene, assets)
    suns = _suns(scene, ior, depth, float(pixel.min()))
    if len(suns) == MOST_DIRECTIONS:
        warnings.append(f"sun.angular_diameter: its blur is sampled by {MOST_DIRECTIONS} directions at most")
    reaches = [refraction_reach(sun, slopes, ior) for sun in suns]
    steepest = max(reach.steepest for reach in reaches)
    if any(reach.clipped for reach in reaches):
        warnings.append("water: the steepest waves bend light past 87 degrees from the vertical; it is not all traced")
    ground, wide = _ground(scene, assets, amplitude, steepest)
    depths = (max(0.0, -ground.highest - amplitude), max(0.0, -ground.lowest) + amplitude)
    reference = 0.5 * (max(0.0, -ground.highest) + max(0.0, -ground.lowest))
    if receiver_kind(scene) == "waves":
        reference = depth
    deviation = _deviation([((r.low, r.high), r.rest) for r in reaches], depths, reference, pixel)
    # Eq. 3.3 meets the ground along the unrefracted ray, so wherever that is.
    anywhere = (0.0, max(0.0, -wide.lowest) + amplitude)
    by_backlund = _deviation([((r.backlund_low, r.backlund_high), r.rest) for r in reaches], anywhere, reference, pixel)
    shifts = np.array([reference * reach.rest for reach in reaches])
    basin: Basin | Sea | None = None
    if scene.water.spectrum is not None:
        basin = make_sea(scene.water.spectrum, depth)
        warnings += basin.warnings
    if scene.water.simulation is not None:
        low, high = np.asarray(scene.map.origin) - shifts.max(axis=0), np.asarray(scene.map.origin) - shifts.min(axis=0)
        low, high = low - deviation[1] * pixel, high + scene.map.size - deviation[0] * pixel
        basin = make_basin(scene, depth, low, high)
    spec = specify(scene, assets, Light(suns, slopes, steepest, amplitude), wide)
    if spec.occluders:
        warnings.append("receiver: a mesh rises above the water; it shades the water, and its dry part is not lit")
    if spec.receiver == "plane" and wide.lowest > -amplitude:
        warnings.append(
            "receiver.plane: troughs may reach below it, and are lit as water; a terrain would be dry there"
        )
    return Facts(
        scene=scene,
        assets=assets,
        spec=spec,
        ior=ior,
        attenuation=_attenuation(scene),
        irradiance=_colour(scene.sun.irradiance, scene.channels),
        suns=suns,
        rest_shifts=shifts,
        reaches=tuple(reaches),
        rest_depth=depth,
        amplitude=amplitude,
        slope=float(np.linalg.norm(slopes, axis=1).max()),
        ground=wide,
        pixel=pixel,
        deviation=deviation,
        backlund_deviation=by_backlund,
        longest_way=float(max(amplitude - wide.lowest, SHALLOWEST) * np.hypot(1.0, steepest)),
        reasons=reasons(scene, spec, len(suns), basin),
        basin=basin,
        warnings=tuple(warnings),
    )


def with_placed_water(scene: Scene, assets: Assets) -> Scene:
    """Return the scene with its simulation's rectangle written down.

    A rectangle that follows from the light differs with its colour and with the map's resolution: scenes that are to
    be one water, as the channels of a dispersed one, are made from this.
    """
    simulation = scene.water.simulation
    if simulation is None or simulation.size is not None:
        return scene
    channels = range(len(CHANNELS)) if scene.medium.dispersion != "none" else ()
    scenes = [channel_scene(scene, channel) for channel in channels] or [scene]
    basins = [gather_facts(one, assets).basin for one in scenes]
    origins = np.array([basin.origin for basin in basins if basin is not None])
    ends = np.array([np.add(basin.origin, basin.size) for basin in basins if basin is not None])
    origin, size = origins.min(axis=0), ends.max(axis=0) - origins.min(axis=0)
    placed = simulation.model_copy(update={"origin": tuple(origin.tolist()), "size": tuple(size.tolist())})
    return scene.model_copy(update={"water": scene.water.model_copy(update={"simulation": placed})})


def _deviation(
    ways: list[tuple[tuple[np.ndarray, ...], np.ndarray]],
    depths: tuple[float, float],
    reference: float,
    pixel: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the deviation [pixels] over all directions of the sun."""
    ends = [deviation_bounds(bounds, rest, depths, reference, pixel) for bounds, rest in ways]
    return np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)


def _attenuation(scene: Scene) -> tuple[float, float, float]:
    medium = scene.medium
    values = _colour(medium.diffuse_attenuation or medium.absorption, 3)
    return (values[0], values[1], values[2])


def _colour(value: float | tuple[float, ...], channels: int) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, tuple) else (float(value),) * channels


def _suns(scene: Scene, ior: float, depth: float, pixel: float) -> np.ndarray:
    direction = np.asarray(scene.sun.unit_direction, dtype=np.float64)
    half = np.radians(scene.sun.angular_diameter) / 2.0
    zenith = float(np.arccos(np.clip(-direction[2], -1.0, 1.0)))
    count = disk_count(half, zenith, ior, depth, pixel)
    suns = disk_directions(direction, half, count)
    return suns[suns[:, 2] < 0.0]  # the part of a setting sun that is still up


def _ground(scene: Scene, assets: Assets, amplitude: float, steepest: float) -> tuple[Bounds, Bounds]:
    """Bounds of all that light can land on, over the map and over all water that can light it, from the level."""
    low = np.asarray(scene.map.origin, dtype=np.float64)
    high = low + np.asarray(scene.map.size)
    over_map = receiver_bounds(scene, assets, low, high)
    pad = steepest * max(scene.water.level - over_map.lowest + amplitude, 0.0)
    wide = receiver_bounds(scene, assets, low - pad, high + pad)
    bounds = [replace(b, lowest=b.lowest - scene.water.level, highest=b.highest - scene.water.level)
              for b in (over_map, wide)]  # fmt: skip
    if assets.objects is not None:
        z = assets.objects.vertices[:, 2] - scene.water.level
        bounds = [replace(b, lowest=min(b.lowest, z.min()), highest=max(b.highest, z.max())) for b in bounds]
    return bounds[0], bounds[1]
