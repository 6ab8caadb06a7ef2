"""Height fields in float64: a tilted plane with sines, the bicubic Hermite patches of a height map, or rings."""

import functools

import warp as wp


@wp.struct
class Sine:
    """One sine: ``a sin(k . x + phase)``, its phase taken at the time and at the map's origin."""

    amplitude: wp.float64  # [m]
    wavevector: wp.vec2d  # [rad/m]
    phase: wp.float64  # [rad]


@wp.struct
class HeightField:
    """z over metres from the map's origin, relative to the water's level; what a scene does not use is empty."""

    base: wp.float64  # [m]
    slope: wp.vec2d
    sines: wp.array[Sine]
    nodes: wp.array2d[wp.vec4d]  # (z, z_u, z_v, z_uv) by node spacing
    middle: wp.vec2d  # of rings, whose sine is the first [m]
    origin: wp.vec2d  # of node (0, 0) [m]
    spacing: wp.vec2d  # of the nodes [m]
    low: wp.vec2d  # lower corner of what is repeated [m]
    period: wp.vec2d  # its size [m]
    steepest: wp.float64  # bound of the slope
    steepest_near: wp.array2d[wp.float64]  # the same, by patch, of all patches within ``window`` of it
    window: wp.float64  # [m]
    highest: wp.float64  # bound of z, either way for water [m]
    step: wp.float64  # smallest step of a march [m]


@wp.func
def sines_at(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec3d:
    """(z, z_x, z_y) of a tilted plane with sines."""
    z = field.base + field.slope[0] * x + field.slope[1] * y
    zx = field.slope[0]
    zy = field.slope[1]
    for i in range(field.sines.shape[0]):
        sine = field.sines[i]
        angle = sine.wavevector[0] * x + sine.wavevector[1] * y + sine.phase
        rise = sine.amplitude * wp.cos(angle)
        z += sine.amplitude * wp.sin(angle)
        zx += rise * sine.wavevector[0]
        zy += rise * sine.wavevector[1]
    return wp.vec3d(z, zx, zy)


@wp.func
def rings_at(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec3d:
    """(z, z_x, z_y) of a sine of the distance from a point, where it has no slope."""
    sine = field.sines[0]
    away = wp.vec2d(x, y) - field.middle
    k = sine.wavevector[0]
    angle = k * wp.length(away) + sine.phase
    slope = sine.amplitude * k * wp.cos(angle) * wp.normalize(away)
    return wp.vec3d(sine.amplitude * wp.sin(angle), slope[0], slope[1])


@wp.func
def cubic(a: wp.float64, b: wp.float64, slope_a: wp.float64, slope_b: wp.float64, t: wp.float64) -> wp.vec2d:
    """Value and derivative at t of the cubic with these ends and end slopes on [0, 1] (monomial form)."""
    square = wp.float64(3.0) * (b - a) - wp.float64(2.0) * slope_a - slope_b
    cube = wp.float64(2.0) * (a - b) + slope_a + slope_b
    return wp.vec2d(
        a + t * (slope_a + t * (square + t * cube)),
        slope_a + t * (wp.float64(2.0) * square + t * wp.float64(3.0) * cube),
    )


@wp.func
def patch_of(position: wp.float64, count: int) -> int:
    """The patch that a position in node units lies in."""
    return int(wp.clamp(wp.floor(position), wp.float64(0.0), wp.float64(count - 2)))


@wp.func
def patches_at(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec3d:
    """(z, z_x, z_y) of a height map; the outer patches reach half a node further, then the edge's height goes on."""
    columns = field.nodes.shape[1]
    rows = field.nodes.shape[0]
    half = wp.float64(0.5)
    px = wp.clamp((x - field.origin[0]) / field.spacing[0], -half, wp.float64(columns) - half)
    py = wp.clamp((y - field.origin[1]) / field.spacing[1], -half, wp.float64(rows) - half)
    i = patch_of(px, columns)
    j = patch_of(py, rows)
    u = px - wp.float64(i)
    v = py - wp.float64(j)
    a = field.nodes[j, i]
    b = field.nodes[j, i + 1]
    c = field.nodes[j + 1, i]
    d = field.nodes[j + 1, i + 1]
    # Along x on both edges of the patch, the height and its slope across; then along y between them.
    low = cubic(a[0], b[0], a[1], b[1], u)
    high = cubic(c[0], d[0], c[1], d[1], u)
    low_across = cubic(a[2], b[2], a[3], b[3], u)
    high_across = cubic(c[2], d[2], c[3], d[3], u)
    z = cubic(low[0], high[0], low_across[0], high_across[0], v)
    along = cubic(low[1], high[1], low_across[1], high_across[1], v)
    return wp.vec3d(z[0], along[0] / field.spacing[0], z[1] / field.spacing[1])


@wp.func
def periodic_at(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec3d:
    """(z, z_x, z_y) of a height map that repeats."""
    across = wp.floor((x - field.low[0]) / field.period[0])
    up = wp.floor((y - field.low[1]) / field.period[1])
    return patches_at(field, x - across * field.period[0], y - up * field.period[1])


@wp.func
def sines_steepness(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec2d:
    """Bound of the slope, and how far around (x, y) it holds [m]: everywhere, for what has no end."""
    return wp.vec2d(field.steepest, wp.float64(wp.inf))


@wp.func
def patches_steepness(field: HeightField, x: wp.float64, y: wp.float64) -> wp.vec2d:
    """Bound of the slope of a height map, and how far around (x, y) it holds [m]."""
    i = patch_of((x - field.origin[0]) / field.spacing[0], field.nodes.shape[1])
    j = patch_of((y - field.origin[1]) / field.spacing[1], field.nodes.shape[0])
    return wp.vec2d(field.steepest_near[j, i], field.window)


@functools.cache
def make_steepness(kind: str) -> wp.Function:
    """The bound of the slope near a point, of a kind of height field."""
    return patches_steepness if kind == "grid" else sines_steepness


@functools.cache
def make_field(kind: str) -> wp.Function:
    """The function of a kind of height field: ``"waves"``, ``"grid"``, ``"periodic"`` or ``"radial"``."""
    return {"grid": patches_at, "periodic": periodic_at, "radial": rings_at}.get(kind, sines_at)
