"""The sampled caustic map of Collard & Mundi, Real-Time Water Caustics (2022), section 3.

No light is followed: what a texel of the map gets is looked up. The water directly above it is the middle of a square
in a map of the water's face normals; for each of some evenly spaced places in that square an intensity is read from an
environment map by how upright a direction is that the normal there, and the way to it, suggest. Their y axis points
up, here z does.

Texture coordinates run from 0 to 1 over the map. As published, horizontal parts of the way to a sample are in texture
coordinates while its height is in metres, so that the picture depends on the unit of length. Theirs are textures of
16-bit floats (normals) and of bytes (intensity); here all of them are float32, limited to 0 to 1 where theirs are.
"""

import functools

import warp as wp

from .box_blur import mirrored
from .photon import Scene
from .surface import HEIGHT_AND_SLOPE

SUN = wp.constant(wp.vec3(0.0, 0.0, 1.0))
"""Towards the sun: overhead, wherever a scene's own stands (3.3)."""

ENVIRONMENT_MIDDLE = wp.constant(0.5)
"""Texture coordinate of the brightest place of the environment map, both ways (3.3, figure 6)."""


@wp.struct
class Sampling:
    """The settings of the method."""

    steps: int  # intervals across the square: steps + 1 samples each way
    size: float  # half of the square's width [texture coordinates]
    ground_offset: float  # height of the water at rest above the ground [m]
    base_intensity: float
    falloff_power: float
    weight_power: float
    environment_power: float


@functools.cache
def make_heights(water: str) -> wp.Kernel:
    """Put the vertices of the water's mesh at the water's height; ``water`` is the kind of surface."""
    water_at = HEIGHT_AND_SLOPE[water]

    @wp.kernel(module="unique", enable_backward=False)
    def heights(
        # In:
        begin: int,
        scene: Scene,
        cell: wp.vec2,
        # Out:
        height_out: wp.array2d[float],
    ):
        """One thread a vertex; launch dims (vertices, vertices). ``cell`` [m]; the first stands at the map's origin."""
        row, column = wp.tid()
        row += begin
        z = water_at(scene.water.surface, float(column) * cell[0], float(row) * cell[1])
        height_out[row, column] = z[0]

    return heights


@wp.func
def facet_normal(height: wp.array2d[float], cell: wp.vec2, x: float, y: float) -> wp.vec3:
    """Unit normal of the triangle of the mesh above a place [cells from the first vertex], upwards.

    Cells are cut from their lower left to their upper right corner.
    """
    column = wp.min(int(x), height.shape[1] - 2)
    row = wp.min(int(y), height.shape[0] - 2)
    a = height[row, column]
    d = height[row + 1, column + 1]
    if y - float(row) <= x - float(column):
        b = height[row, column + 1]
        return wp.normalize(wp.vec3((a - b) / cell[0], (b - d) / cell[1], 1.0))
    c = height[row + 1, column]
    return wp.normalize(wp.vec3((c - d) / cell[0], (a - c) / cell[1], 1.0))


@wp.kernel(enable_backward=False)
def face_normals(
    # In:
    begin: int,
    height: wp.array2d[float],
    cell: wp.vec2,
    # Out:
    normal_out: wp.array2d[wp.vec3],
):
    """Render the mesh from above: the normal of the triangle at each texel's middle; launch dims (rows, columns)."""
    row, column = wp.tid()
    row += begin
    x = (float(column) + 0.5) / float(normal_out.shape[1]) * float(height.shape[1] - 1)
    y = (float(row) + 0.5) / float(normal_out.shape[0]) * float(height.shape[0] - 1)
    normal_out[row, column] = facet_normal(height, cell, x, y)


@wp.func
def normal_at(normals: wp.array2d[wp.vec3], x: float, y: float) -> wp.vec3:
    """Unit normal at a place [texels], bilinear between texels' middles (GL_LINEAR) and mirrored at the borders."""
    left = wp.floor(x - 0.5)
    low = wp.floor(y - 0.5)
    u = x - 0.5 - left
    v = y - 0.5 - low
    i = mirrored(int(left), normals.shape[1])
    k = mirrored(int(left) + 1, normals.shape[1])
    j = mirrored(int(low), normals.shape[0])
    m = mirrored(int(low) + 1, normals.shape[0])
    below = (1.0 - u) * normals[j, i] + u * normals[j, k]
    above = (1.0 - u) * normals[m, i] + u * normals[m, k]
    return wp.normalize((1.0 - v) * below + v * above)


@wp.func
def weighted_direction(normal: wp.vec3, way: wp.vec3, power: float) -> wp.vec3:
    """Return the direction that stands for the refracted one: the normal, with less of its upright part by n·way.

    (n_x, n_y, (1 - (n·way)^power) n_z), normalised, after `causticMap.frag` (commit 8c3f207, power 64) in the authors'
    public repository, sebastiancollard/Water-Caustics: the paper gives no formula. Zero where the way runs along an
    upright normal, which is then dark, as all directions close to it are.
    """
    weight = wp.pow(wp.clamp(wp.dot(way, normal), 0.0, 1.0), power)
    return wp.normalize(wp.vec3(normal[0], normal[1], (1.0 - weight) * normal[2]))


@wp.func
def environment_coordinate(direction: wp.vec3) -> float:
    """Both texture coordinates of the environment map for a direction: half its cosine with the sun's, at least 0."""
    return wp.max(wp.dot(direction, SUN) / 2.0, 0.0)


@wp.func
def radial_intensity(coordinate: float, power: float) -> float:
    """Built-in environment map at (coordinate, coordinate): 1 at its middle, 0 from the borders' middles outwards."""
    distance = wp.sqrt(2.0) * (ENVIRONMENT_MIDDLE - coordinate)
    return wp.pow(wp.max(1.0 - distance / ENVIRONMENT_MIDDLE, 0.0), power)


@wp.func
def image_intensity(environment: wp.array2d[float], coordinate: float) -> float:
    """Environment map from an image at (coordinate, coordinate), bilinear between texels; its edge goes on outside."""
    rows = environment.shape[0]
    columns = environment.shape[1]
    x = wp.max(coordinate * float(columns) - 0.5, 0.0)
    y = wp.max(coordinate * float(rows) - 0.5, 0.0)
    i = int(x)
    j = int(y)
    k = wp.min(i + 1, columns - 1)
    m = wp.min(j + 1, rows - 1)
    u = x - float(i)
    v = y - float(j)
    upper = (1.0 - u) * environment[j, i] + u * environment[j, k]
    lower = (1.0 - u) * environment[m, i] + u * environment[m, k]
    return (1.0 - v) * upper + v * lower


@functools.cache
def make_sample(image: bool) -> wp.Kernel:
    """Add up what the samples of each texel's square look up; ``image`` is where the environment map comes from."""

    @wp.kernel(module="unique", enable_backward=False)
    def sample(
        # In:
        begin: int,
        normal: wp.array2d[wp.vec3],
        environment: wp.array2d[float],
        sampling: Sampling,
        # Out:
        caustic_out: wp.array2d[float],
    ):
        """One thread a texel, from row ``begin``; launch dims (rows, columns).

        The sum is limited to 0 to 1, as their texture does.
        """
        row, column = wp.tid()
        row += begin
        rows = float(normal.shape[0])
        columns = float(normal.shape[1])
        total = float(0.0)
        for j in range(sampling.steps + 1):
            v = sampling.size * (2.0 * float(j) / float(sampling.steps) - 1.0)
            for i in range(sampling.steps + 1):
                u = sampling.size * (2.0 * float(i) / float(sampling.steps) - 1.0)
                way = wp.normalize(wp.vec3(u, v, sampling.ground_offset))
                n = normal_at(normal, float(column) + 0.5 + u * columns, float(row) + 0.5 + v * rows)
                direction = weighted_direction(n, way, sampling.weight_power)
                coordinate = environment_coordinate(direction)
                intensity = float(0.0)
                if wp.static(image):
                    intensity = image_intensity(environment, coordinate)
                else:
                    intensity = radial_intensity(coordinate, sampling.environment_power)
                falloff = wp.pow(1.0 - wp.sqrt(u * u + v * v), sampling.falloff_power)
                total += intensity * sampling.base_intensity * falloff
        caustic_out[row, column] = wp.clamp(total, 0.0, 1.0)

    return sample


@wp.kernel(enable_backward=False)
def scale_to_irradiance(
    # In:
    begin: int,
    caustic: wp.array2d[float],
    irradiance: wp.vec3,
    colours: int,
    # Out:
    caustic_map_out: wp.array[float],
):
    """Multiply the intensity by an irradiance, by colour; launch dims (rows, columns)."""
    row, column = wp.tid()
    row += begin
    for c in range(colours):
        caustic_map_out[(row * caustic.shape[1] + column) * colours + c] = caustic[row, column] * irradiance[c]
