"""The photons of a cascade: one a texel of its light view, refracted, landed, splatted into the eye's picture.

A texel of a parallel light view takes in the same flux wherever it meets the water: the sun's irradiance times the
texel's area across the light. That is the unit of flux here; directions of the sun's disk share it, each by how the
water at the texel faces it. What stands in the light is not seen by the view, so that
crests shade troughs without a test. Bäcklund's thesis, 3.4; its constant brightness is the other branch.
"""

import functools
from dataclasses import dataclass

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .eye_splat import make_splat_eye, on_screen, outline, screen_step
from .ledger import ABSORBED, DROPPED, EMITTED, LEFT_WATER, OUTSIDE_MAP, REFLECTED, SHADED, bin_of, tally
from .light_g_buffer import POSITION_STORAGE, make_texel_position
from .optics import facing, refract_at_slope, transmittance_at_slope
from .packing import NORMAL_STORAGE, UNPACK
from .photon import (
    BLOCKED,
    DRY,
    LANDED,
    LANDED_ON_OBJECT,
    LEFT,
    LOST,
    UNLIT,
    Photon,
    Scene,
    SunSample,
    make_attenuate,
    make_photon,
)
from .project import project_backlund
from .spec import Spec
from .views import View

STEEPEST_SLOPE = wp.constant(1.0e3)  # a rebuilt normal that lies flatter than this is one of rounding alone
LEAST_FACING = wp.constant(1.0e-4)  # of water to the light that a view looks along: less is a silhouette's rounding
LEAST_DESCENT = wp.constant(-1.0e-3)  # cosine at which a ray grazes the receiver: its footprint is as long as the view


@dataclass(frozen=True)
class CascadeSpec:
    """What a cascade's kernels contain.

    Attributes
    ----------
    scene : Spec
        Of the scene; crests' shadows are the light view's own.
    positions, normals : str
        How the G-buffers store them: ``POSITION_STORAGE``, ``NORMAL_STORAGE``.
    ground : bool
        The ground is seen by the light view, too, and Eq. 3.3 lands by its point of the same texel.
    footprint : str
        ``"point"``, ``"pixel"`` or ``"texel"``.
    dispersed : bool
        Each channel is refracted by its own index.
    brightness : str
        ``"flux"``, ``"hard"`` or ``"smooth"``: a constant with the thesis's ramps.
    booked : bool
        The light is entered into the ledger.
    """

    scene: Spec
    positions: str = "depth"
    normals: str = "float3"
    ground: bool = False
    footprint: str = "texel"
    dispersed: bool = False
    brightness: str = "flux"
    booked: bool = False


@wp.struct
class Ramps:
    """The thesis's constant brightness, and the depths at which it begins and ends."""

    least: float  # [m]
    most: float  # [m]


@wp.func
def ramp_hard(ramps: Ramps, depth: float) -> float:
    """Brightness of a photon under so much water [m], as published first: ramps of a metre at either end."""
    deep = wp.min(1.0, wp.max(0.0, ramps.most - depth))
    shallow = wp.min(1.0, wp.max(0.0, depth - ramps.least))
    return deep * shallow


@wp.func
def ramp_smooth(ramps: Ramps, depth: float) -> float:
    """As :func:`ramp_hard`, with a brightness that falls all the way down: the thesis's stand-in for absorption."""
    deep = wp.min(1.0, wp.max(0.0, (ramps.most - depth) / ramps.most))
    shallow = wp.min(1.0, wp.max(0.0, depth - ramps.least))
    return deep * shallow


RAMPS = {"hard": ramp_hard, "smooth": ramp_smooth}
"""The thesis's brightness by depth, as published first and as changed later."""


@functools.cache
def make_follow(spec: CascadeSpec) -> wp.Function:
    """Follow a photon from its texel's water to where it lands: exactly, or by Eq. 3.3 and the texel's ground."""
    photon = make_photon(spec.scene)
    attenuate = make_attenuate(spec.scene)
    fresnel = spec.scene.fresnel

    @wp.func
    def follow(scene: Scene, sun: wp.vec3, origin: wp.vec3, slope: wp.vec2, ground: wp.vec3) -> Photon:
        if wp.static(spec.ground):
            result = Photon()
            result.origin = origin
            result.incident = facing(sun, slope)
            result.direction = refract_at_slope(sun, slope, scene.medium.eta)
            result.transmitted = result.incident
            if wp.static(fresnel):
                result.transmitted *= transmittance_at_slope(sun, result.direction, slope, scene.medium.ior)
            result.normal = wp.vec3(0.0, 0.0, 1.0)
            result.state = LANDED
            if not wp.isfinite(ground):
                result.state = LEFT
            elif wp.dot(ground - origin, sun) <= 0.0:
                result.state = DRY  # the light meets the ground first
            elif result.incident <= 0.0:
                result.state = UNLIT
            else:
                result.distance = wp.length(project_backlund(origin, ground, result.direction) - origin)
                result.arrived = result.transmitted * attenuate(scene.medium, result.distance, result.direction)
            return result
        else:
            return photon(scene, sun, wp.vec2(origin[0], origin[1]), wp.vec3(origin[2], slope[0], slope[1]))

    return follow


@wp.func
def slope_of(normal: wp.vec3) -> wp.vec2:
    """Slope of a surface from its normal, bounded."""
    up = wp.max(normal[2], 1.0 / STEEPEST_SLOPE)
    return wp.vec2(-normal[0] / up, -normal[1] / up)


@wp.func
def steps_on_receiver(view: View, sun: wp.vec3, result: Photon) -> wp.mat33:
    """Steps [m] of a texel's two sides where its photon lands, and the landing, as rows.

    A side is carried along the light to the level water, then along the refracted ray to the receiver's plane.
    """
    normal = wp.normalize(result.normal)
    descent = wp.min(wp.dot(normal, result.direction), LEAST_DESCENT)
    u = wp.vec3(wp.vec3d(view.inverse[0, 0], view.inverse[1, 0], view.inverse[2, 0]))
    v = wp.vec3(wp.vec3d(view.inverse[0, 1], view.inverse[1, 1], view.inverse[2, 1]))
    u = u - u[2] / sun[2] * sun
    v = v - v[2] / sun[2] * sun
    u = u - wp.dot(normal, u) / descent * result.direction
    v = v - wp.dot(normal, v) / descent * result.direction
    return wp.matrix_from_rows(u, v, result.origin + result.distance * result.direction)


@wp.func
def book(
    ledger: wp.array2d[wp.float64],
    channels: int,
    c: int,
    bin: int,
    state: int,
    incident: float,
    transmitted: float,
    arrived: float,
    accepted: float,
):
    """Enter a photon's flux into the ledger; ``accepted`` is what pixels took of what ``arrived``."""
    if state == DRY:
        return
    tally(ledger, EMITTED * channels + c, bin, incident)
    if state == BLOCKED or state == UNLIT:  # at the silhouette of a crest: it grazes
        tally(ledger, SHADED * channels + c, bin, incident)
    elif state == LOST:
        tally(ledger, DROPPED * channels + c, bin, incident)
    else:
        tally(ledger, REFLECTED * channels + c, bin, incident - transmitted)
        if state == LEFT:
            tally(ledger, LEFT_WATER * channels + c, bin, transmitted)
        else:
            tally(ledger, ABSORBED * channels + c, bin, transmitted - arrived)
            tally(ledger, OUTSIDE_MAP * channels + c, bin, arrived - accepted)


@functools.cache
def make_cascade_photons(spec: CascadeSpec) -> wp.Kernel:
    """Splat the photons of a cascade into its picture of the eye."""
    follow = make_follow(spec)
    water_position_at = make_texel_position(spec.positions)
    position_type, normal_type = POSITION_STORAGE[spec.positions], NORMAL_STORAGE[spec.normals]
    unpack = UNPACK[spec.normals]
    bounded, channels, dispersed = spec.scene.bounded, spec.scene.channels, spec.dispersed
    lanes = 1 if dispersed else channels
    splat_eye = make_splat_eye(spec.footprint, spec.scene.accumulate, lanes)
    flux_type, dtype = FLUX[lanes], ACCUMULATOR[spec.scene.accumulate]
    published, spread = spec.brightness != "flux", spec.footprint == "texel"
    brightness = RAMPS.get(spec.brightness, ramp_hard)

    @wp.kernel(module="unique", enable_backward=False)
    def cascade_photons(
        # In:
        begin: int,
        scene: Scene,
        suns: wp.array[SunSample],
        light_direction: wp.vec3,
        light_view: wp.array[View],
        water_position: wp.array2d[position_type],
        water_normal: wp.array2d[normal_type],
        ground_position: wp.array2d[position_type],
        border_low: wp.vec2,
        border_high: wp.vec2,
        eye_view: wp.array[View],
        eye_plane: wp.array2d[wp.vec4],
        ior: wp.vec3,
        first_channel: int,
        last_channel: int,
        ramps: Ramps,
        # Out:
        light_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a texel; launch dims (rows, columns) of the light view.

        Channels from ``first_channel`` to before ``last_channel`` are refracted each by its ``ior``; light that is not
        dispersed has one round, whose index is the first, and carries all channels.
        """
        row, column = wp.tid()
        row += begin
        view = light_view[0]
        origin = water_position_at(view, water_position, column, row)
        if not wp.isfinite(origin):
            return
        if wp.static(bounded):
            if origin[0] < border_low[0] or origin[1] < border_low[1]:
                return
            if origin[0] > border_high[0] or origin[1] > border_high[1]:
                return
        slope = slope_of(unpack(water_normal[row, column]))
        whole = wp.max(facing(light_direction, slope), LEAST_FACING)
        ground = wp.vec3(0.0, 0.0, 0.0)
        if wp.static(spec.ground):
            ground = water_position_at(view, ground_position, column, row)
        rounds = last_channel - first_channel
        for round in range(suns.shape[0] * rounds):
            sun = suns[round // rounds].direction
            channel = first_channel + round % rounds
            scene.medium.ior = ior[channel]
            scene.medium.eta = 1.0 / ior[channel]
            result = follow(scene, sun, origin, slope, ground)
            accepted = float(0.0)
            flux = flux_type()
            if result.state == LANDED or result.state == LANDED_ON_OBJECT:
                where = steps_on_receiver(view, light_direction, result)
                landing = wp.vec3(where[2, 0], where[2, 1], where[2, 2])
                for c in range(wp.static(lanes)):
                    if wp.static(published):
                        flux[c] = brightness(ramps, origin[2] - landing[2]) / float(suns.shape[0])
                    elif wp.static(dispersed):
                        flux[c] = result.arrived[channel] / whole
                    else:
                        flux[c] = result.arrived[c] / whole
                normal = result.normal
                if wp.static(spec.ground):
                    normal = wp.vec3(0.0, 0.0, 0.0)  # Eq. 3.3 does not know on what it lands
                at = on_screen(eye_view[0], landing)
                ellipse = wp.vec3(0.0, 0.0, 0.0)
                if wp.static(spread):
                    if at[2] > 0.0:
                        u = screen_step(eye_view[0], at, wp.vec3(where[0, 0], where[0, 1], where[0, 2]))
                        v = screen_step(eye_view[0], at, wp.vec3(where[1, 0], where[1, 1], where[1, 2]))
                        ellipse = outline(u, v)
                if wp.static(dispersed):
                    accepted = splat_eye(light_out, eye_plane, landing, normal, at, ellipse, flux, channels, channel)
                else:
                    accepted = splat_eye(light_out, eye_plane, landing, normal, at, ellipse, flux, 1, 0)
            if wp.static(spec.booked):
                bin = bin_of(row, column)
                # Water that this direction grazes from below takes in nothing; at a silhouette the view may see it.
                incident = wp.max(result.incident, 0.0) / whole
                transmitted = wp.max(result.transmitted, 0.0) / whole
                if wp.static(dispersed):
                    taken = accepted * flux[0]
                    book(ledger_out, channels, channel, bin, result.state, incident, transmitted, flux[0], taken)
                else:
                    for c in range(wp.static(channels)):
                        taken = accepted * flux[c]
                        book(ledger_out, channels, c, bin, result.state, incident, transmitted, flux[c], taken)

    return cascade_photons
