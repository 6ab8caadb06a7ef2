"""Photon differentials: how a photon's place and direction change with its place on the surface.

Igehy, "Tracing Ray Differentials" (1999), for photons as Schjøth et al., "Photon Differentials" (2007), and Frisvad et
al., "Photon Differential Splatting for Rendering Caustics" (2014): one photon a cell carries what its cell's two edges
become, so its footprint where it lands follows from the water's curvature alone, without its neighbours.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR, FLUX
from .footprint import make_deposit_ellipse, make_deposit_parallelogram
from .lattice import Lattice, at_rest, clip_to_water, deviation, on_water, pixel_base, pixel_fraction, share_of_cell
from .ledger import bin_of, make_book_landed, make_count_unlanded
from .photon import LANDED, LANDED_ON_OBJECT, Photon, Scene, SunSample, make_photon
from .spec import Spec
from .splat import FARTHEST
from .wave_table import make_curved_water_on_lattice
from .waves import vec6


@wp.func
def normal_of(z: vec6) -> wp.vec3:
    """Unit normal of a height field (z, z_x, z_y, z_xx, z_xy, z_yy)."""
    return wp.normalize(wp.vec3(-z[1], -z[2], 1.0))


@wp.func
def normal_differential(z: vec6, edge: wp.vec2) -> wp.vec3:
    """How the unit normal of a height field changes along a horizontal edge [m], to first order.

    Of m = (-z_x, -z_y, 1) the change is dm = -(z_xx dx + z_xy dy, z_xy dx + z_yy dy, 0), and of N = m / |m| it is
    (dm - N (N . dm)) / |m|.
    """
    length = wp.sqrt(1.0 + z[1] * z[1] + z[2] * z[2])
    normal = wp.vec3(-z[1], -z[2], 1.0) / length
    change = -wp.vec3(z[3] * edge[0] + z[4] * edge[1], z[4] * edge[0] + z[5] * edge[1], 0.0)
    return (change - normal * wp.dot(normal, change)) / length


@wp.func
def refract_differential(
    direction: wp.vec3, change: wp.vec3, refracted: wp.vec3, normal: wp.vec3, normal_change: wp.vec3, eta: float
) -> wp.vec3:
    """How a refracted direction changes with the incident one's ``change`` and the normal's (Igehy 1999).

    R = eta D - mu N with mu = eta (D . N) - (R . N), so dR = eta dD - (mu dN + dmu N) with
    dmu = (eta - eta^2 (D . N) / (R . N)) (dD . N + D . dN).
    """
    before = wp.dot(direction, normal)
    after = wp.dot(refracted, normal)
    mu = eta * before - after
    turn = (eta - eta * eta * before / after) * (wp.dot(change, normal) + wp.dot(direction, normal_change))
    return eta * change - (mu * normal_change + turn * normal)


@wp.func
def transfer_differential(
    edge: wp.vec3, direction: wp.vec3, change: wp.vec3, distance: float, normal: wp.vec3
) -> wp.vec3:
    """What an edge of a beam becomes where it meets a receiver of this normal (of any length), a distance further.

    P' = P + t D on both rays, and t changes so that the edge stays in the receiver's tangent plane.
    """
    straight = edge + distance * change
    return straight - wp.dot(straight, normal) / wp.dot(direction, normal) * direction


@wp.func
def landed_edge(sun: wp.vec3, eta: float, photon: Photon, z: vec6, edge: wp.vec2) -> wp.vec2:
    """Plan view [m] of what a horizontal edge [m] of the surface at a photon becomes where the photon lands.

    The sun's rays are parallel: the incident direction does not change.
    """
    on_surface = wp.vec3(edge[0], edge[1], z[1] * edge[0] + z[2] * edge[1])
    normal_change = normal_differential(z, edge)
    change = refract_differential(sun, wp.vec3(0.0, 0.0, 0.0), photon.direction, normal_of(z), normal_change, eta)
    landed = transfer_differential(on_surface, photon.direction, change, photon.distance, photon.normal)
    return wp.vec2(landed[0], landed[1])


@functools.cache
def make_differential(spec: Spec, ellipse: bool) -> wp.Kernel:
    """Splat the photons of a strip, each as wide as its differentials say."""
    photon = make_photon(spec)
    curved_water_on_lattice = make_curved_water_on_lattice(spec)
    make_deposit = make_deposit_ellipse if ellipse else make_deposit_parallelogram
    deposit = make_deposit(spec.accumulate, spec.channels)
    book_landed = make_book_landed(spec)
    count_unlanded = make_count_unlanded(spec)
    dtype = ACCUMULATOR[spec.accumulate]
    flux_type = FLUX[spec.channels]
    channels, bounded = spec.channels, spec.bounded

    @wp.kernel(module="unique", enable_backward=False)
    def differential(
        # In:
        scene: Scene,
        suns: wp.array[SunSample],
        sun: int,
        lattice: Lattice,
        first_row: int,
        largest: float,
        column_waves: wp.array2d[wp.vec2],
        row_waves: wp.array2d[wp.vec2],
        # Out:
        map_out: wp.array[dtype],
        ledger_out: wp.array2d[wp.float64],
    ):
        """One thread a photon of the strip; launch dims (rows, columns) of cells; ``largest`` in pixels."""
        row, column = wp.tid()
        light = suns[sun]
        index = wp.vec2i(lattice.first[0] + column, first_row + row)
        rest = at_rest(lattice, index, 0.5)
        share = float(1.0)
        side = wp.vec2(lattice.step, lattice.step)
        if wp.static(bounded):
            low = clip_to_water(lattice, at_rest(lattice, index, 0.0), light.rest_shift)
            high = clip_to_water(lattice, at_rest(lattice, index, 1.0), light.rest_shift)
            rest = 0.5 * (low + high)
            side = high - low
            share = share_of_cell(lattice, low, high)
            if not share > 0.0:
                return
        water = on_water(lattice, rest, light.rest_shift)
        z = curved_water_on_lattice(scene, column_waves, row_waves, column, row, water)
        result = photon(scene, light.direction, water, wp.vec3(z[0], z[1], z[2]))
        bin = bin_of(row, column)
        if result.state != LANDED and result.state != LANDED_ON_OBJECT:
            count_unlanded(ledger_out, bin, result.state, share * result.incident, share * result.transmitted)
            return
        flux = flux_type()
        for c in range(wp.static(channels)):
            flux[c] = share * result.arrived[c]
        base = pixel_base(rest)
        at = pixel_fraction(rest, base) + deviation(lattice, result.distance, result.direction, light.rest_shift)
        inside = float(0.0)
        if wp.abs(at[0]) < wp.static(FARTHEST) and wp.abs(at[1]) < wp.static(FARTHEST):
            # From the pixel that it falls in, so that its outline keeps its digits wherever it lands.
            whole = pixel_base(at)
            metres = wp.cw_mul(side, lattice.pixel)
            eta = scene.medium.eta
            u = landed_edge(light.direction, eta, result, z, wp.vec2(metres[0], 0.0))
            v = landed_edge(light.direction, eta, result, z, wp.vec2(0.0, metres[1]))
            u = wp.cw_div(u, lattice.pixel)
            v = wp.cw_div(v, lattice.pixel)
            inside = deposit(map_out, lattice.map, base + whole, pixel_fraction(at, whole), u, v, largest, flux)
        book_landed(ledger_out, bin, share * result.incident, share * result.transmitted, flux, inside * flux)

    return differential
