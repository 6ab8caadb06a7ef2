"""From the cascades' pictures to one: per pixel the finest cascade that reaches it, as irradiance on what it sees.

Bäcklund's thesis, 3.5, switches from one cascade to the next at its far plane. With a zone of blending the weights of
all cascades add up to 1 at every depth, so that the light stays as it is across a border. Each cascade takes its part
of what the finer ones have left, and the last takes the rest: so a pixel whose light a view does not hold, since the
eye has turned or gone since views were fitted, falls to the next one.
"""

import functools

import warp as wp

from .deposit import ACCUMULATOR
from .eye_surface import lies_on, pixel_ray
from .optics import facing
from .photon import Scene, SunSample, share_lit
from .project import FAR, make_clearance
from .spec import Spec
from .surface import HEIGHT_AND_SLOPE
from .views import View, project, unproject


@wp.func
def reaches(depth: float, far: float, zone: float) -> float:
    """How far a cascade that ends at ``far`` still counts at a depth: 1 before its zone of blending, 0 beyond it."""
    if depth > far:
        return 0.0
    if depth <= far - zone:
        return 1.0
    return (far - depth) / zone


@wp.func
def holds(view: View, point: wp.vec3, need: wp.vec4, side: float, zone: float) -> float:
    """How far a light view holds all water that can light a point: 1 by a zone of texels or more, 0 if it does not.

    ``need`` is how far that water may stand to either side [texels], lowest and highest; ``side`` is the view's.
    """
    at = project(view, point)
    room = wp.min(wp.min(at[0] + need[0], at[1] + need[1]), wp.min(side - at[0] - need[2], side - at[1] - need[3]))
    if room < 0.0:
        return 0.0
    if room >= zone:
        return 1.0
    return room / zone


@functools.cache
def make_composite(accumulate: str, channels: int, colours: int, flux: bool) -> wp.Kernel:
    """Add a cascade to the picture; without ``flux`` its brightness is a constant's and no area divides it."""
    dtype = ACCUMULATOR[accumulate]

    @wp.kernel(module="unique", enable_backward=False)
    def composite(
        # In:
        begin: int,
        light: wp.array[dtype],
        eye_view: wp.array[View],
        eye_depth: wp.array2d[float],
        eye_area: wp.array2d[float],
        light_view: wp.array[View],
        reach: wp.vec2,
        need: wp.vec4,
        side: float,
        zone: float,
        scale: wp.vec3d,
        # Out:
        left_out: wp.array2d[float],
        picture_out: wp.array[float],
    ):
        """One thread a pixel; launch dims (rows, columns).

        ``reach`` is where the cascade ends and the depth before that over which it gives way [m], ``zone`` the same of
        its view's sides [texels]; a view without a side (0) takes all that is left. ``left_out`` is what the finer
        cascades have left of each pixel, and what this one leaves. ``scale`` is the flux of an accumulator's unit by
        colour.
        """
        row, column = wp.tid()
        row += begin
        depth = eye_depth[row, column]
        if not wp.isfinite(depth):
            return
        weight = left_out[row, column]
        if side > 0.0:
            weight *= reaches(depth, reach[0], reach[1])
            if weight > 0.0:
                point = unproject(eye_view[0], float(column) + 0.5, float(row) + 0.5, depth)
                weight *= holds(light_view[0], point, need, side, zone)
        if weight <= 0.0:
            return
        left_out[row, column] = left_out[row, column] - weight
        if wp.static(flux):
            weight /= eye_area[row, column]
        pixel = row * eye_depth.shape[1] + column
        for c in range(wp.static(colours)):
            taken = light[pixel * wp.static(channels) + wp.where(wp.static(channels) == 1, 0, c)]
            at = pixel * wp.static(colours) + c
            picture_out[at] = picture_out[at] + float(wp.float64(taken) * scale[c] * wp.float64(weight))

    return composite


@functools.cache
def make_dry_picture(spec: Spec, colours: int) -> wp.Kernel:
    """Light dry land that the eye sees directly: E max(0, -N . I), unless a hill stands in the sun."""
    water_at = HEIGHT_AND_SLOPE[spec.water]
    kind = spec.receiver if spec.receiver in HEIGHT_AND_SLOPE else "waves"
    terrain_at = HEIGHT_AND_SLOPE[kind]
    clear_of_land = make_clearance(kind)
    hills_shade = spec.hills_shade

    @wp.kernel(module="unique", enable_backward=False)
    def dry_picture(
        # In:
        begin: int,
        scene: Scene,
        suns: wp.array[SunSample],
        eye_view: wp.array[View],
        eye_depth: wp.array2d[float],
        eye_plane: wp.array2d[wp.vec4],
        irradiance: wp.vec3,
        # Out:
        picture_out: wp.array[float],
    ):
        """One thread a pixel; launch dims (rows, columns)."""
        row, column = wp.tid()
        row += begin
        depth = eye_depth[row, column]
        if not wp.isfinite(depth):
            return
        view = eye_view[0]
        x = float(column) + 0.5
        y = float(row) + 0.5
        point = unproject(view, x, y, depth)
        land = scene.receiver
        ground = terrain_at(land.terrain, point[0], point[1])
        if ground[0] < -scene.water.amplitude:
            return
        if not lies_on(
            eye_plane[row, column], wp.vec3(point[0], point[1], ground[0]), wp.vec3(-ground[1], -ground[2], 1.0)
        ):
            return  # an object stands there
        # The pixel's width on the land, across the ray: the shore is filtered over it.
        width = wp.length(depth * (pixel_ray(view, x + 1.0, y) - pixel_ray(view, x, y)))
        size = wp.vec2(width, width)
        water = water_at(scene.water.surface, point[0], point[1])
        dry = share_lit(ground[0] - water[0], wp.vec2(ground[1] - water[1], ground[2] - water[2]), size)
        light = float(0.0)
        for k in range(suns.shape[0]):
            sun = suns[k].direction
            direct = dry * wp.max(0.0, facing(sun, wp.vec2(ground[1], ground[2])))
            if wp.static(hills_shade):
                if direct > 0.0:
                    origin = wp.vec3(point[0], point[1], ground[0])
                    near = clear_of_land(land.terrain, origin, -sun, 1.0, land.slope, land.highest, land.step)
                    if near[0] < FAR:
                        hill = terrain_at(land.terrain, origin[0] - near[1] * sun[0], origin[1] - near[1] * sun[1])
                        direct *= share_lit(near[0], wp.vec2(ground[1] - hill[1], ground[2] - hill[2]), size)
            light += direct
        # `facing` is per horizontal area; the eye sees the area of the land itself.
        light /= wp.sqrt(1.0 + ground[1] * ground[1] + ground[2] * ground[2])
        pixel = row * eye_depth.shape[1] + column
        for c in range(wp.static(colours)):
            at = pixel * wp.static(colours) + c
            picture_out[at] = picture_out[at] + light * irradiance[c]

    return dry_picture
