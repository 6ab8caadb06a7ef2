"""Rasterization: triangles to a visibility buffer that holds the nearest triangle of each pixel.

Four launches. `project_vertices_kernel` projects each vertex once, so that triangles which share it share it to the
last bit. `fill_small_kernel` takes a triangle a thread: cuts off what lies before the near plane, fills it where it is
small, and puts it on a list where it is large. `fill_large_kernel` takes the listed triangles a block of pixels at a
time. `kernels/g_buffer.py` then resolves the visibility buffer.

Coverage is exact: corners are rounded to 1/4096 of a pixel and the edge functions are 64-bit integers, so that with the
top-left rule each pixel centre on a shared edge belongs to one of its two triangles. A mesh whose triangles still face
the same way once rounded covers each pixel once.
"""

import warp as wp

from .frustum import GUARD, Polygon, visible_polygon
from .views import View, homogeneous_w, project
from .visibility import visibility_key

SUBPIXEL_BITS = wp.constant(12)  # float32 resolves no more at 4096 pixels; edge functions stay under 2^57
SUBPIXELS = wp.constant(1 << 12)
PIXEL_STEP = wp.constant(wp.int64(1 << 12))  # SUBPIXELS, for the edge functions
CENTRE = wp.constant(1 << 11)  # of a pixel, in sub-pixels
BLOCK = wp.constant(16)  # [pixels] side of the blocks that large triangles are filled by
BLOCK_PIXELS = wp.constant(16 * 16)  # a triangle whose rectangle holds no more is filled at once
PIECE_BITS = wp.constant(wp.uint64(40))  # of the tally: pieces below, list entries above
ONE_ENTRY = wp.constant(wp.uint64(1 << 40))

NOT_FINITE = wp.constant(0)  # what `dropped_out` counts: triangles with a corner that is NaN or infinite,
BAD_INDEX = wp.constant(1)  # triangles that name a vertex which is not there

# More would need a wider guard band or fewer sub-pixel bits.
MAX_RESOLUTION = 16384
# Entries of the list of large triangles. Past them a triangle is filled by its own thread; the tally cannot overflow:
# 2^18 entries, and as many again from threads in flight, of at most 2^20 blocks each stay under 2^40.
MAX_LARGE = 1 << 18


@wp.func
def snap(view: View, corner: wp.vec3) -> wp.vec2i:
    """Column and row of a corner in sub-pixels; bounded by the guard band."""
    w = homogeneous_w(view, corner[2])
    x = wp.clamp(corner[0] / w, -GUARD, GUARD)
    y = wp.clamp(corner[1] / w, -GUARD, GUARD)
    return wp.vec2i(int(wp.rint(x * float(SUBPIXELS))), int(wp.rint(y * float(SUBPIXELS))))


@wp.func
def first_centre(position: int) -> int:
    """Index of the first pixel whose centre does not lie before a position in sub-pixels."""
    return (position - CENTRE + SUBPIXELS - 1) >> SUBPIXEL_BITS


@wp.func
def pixel_rectangle(view: View, polygon: Polygon, count: int, columns: int, rows: int) -> wp.vec4i:
    """Pixels that a polygon may cover: first column, first row, one past the last of each; inside the picture."""
    low = snap(view, polygon[0])
    high = low
    for i in range(1, count):
        corner = snap(view, polygon[i])
        low = wp.min(low, corner)
        high = wp.max(high, corner)
    return wp.vec4i(
        wp.max(first_centre(low[0]), 0),
        wp.max(first_centre(low[1]), 0),
        wp.min(first_centre(high[0] + 1), columns),
        wp.min(first_centre(high[1] + 1), rows),
    )


@wp.func
def blocks(pixels: int) -> int:
    """Blocks that cover this many pixels in a row."""
    return (pixels + BLOCK - 1) // BLOCK


@wp.func
def block_of(rectangle: wp.vec4i, block: int) -> wp.vec4i:
    """One block of a rectangle of pixels; blocks are counted along its rows."""
    across = blocks(rectangle[2] - rectangle[0])
    column = rectangle[0] + (block % across) * BLOCK
    row = rectangle[1] + (block // across) * BLOCK
    return wp.vec4i(column, row, wp.min(column + BLOCK, rectangle[2]), wp.min(row + BLOCK, rectangle[3]))


@wp.func
def list_entries(tally: wp.uint64) -> int:
    """Entries that a tally counts."""
    return int(tally >> PIECE_BITS)


@wp.struct
class Fill:
    """A triangle over a rectangle of pixels; threes belong to the corners a, b, c and to the edges opposite them."""

    first_column: int
    first_row: int
    columns: int  # 0 where it covers nothing
    rows: int
    edge: wp.vec3l  # edge functions at the first centre, less one on edges that are not its own: inside is >= 0
    bias: wp.vec3l
    step_x: wp.vec3l  # of the edge functions, to the next column and row
    step_y: wp.vec3l
    weight: wp.vec3  # 1 / w
    depth: wp.vec3  # Z / w [m]


@wp.func
def edge_function(p: wp.vec2i, q: wp.vec2i, x: int, y: int) -> wp.int64:
    """Twice the signed area of (p, q, (x, y)), in sub-pixels squared: positive to the left of p to q."""
    along = wp.int64(q[0] - p[0]) * wp.int64(y - p[1])
    return along - wp.int64(q[1] - p[1]) * wp.int64(x - p[0])


@wp.func
def edge_bias(step_x: wp.int64, step_y: wp.int64) -> wp.int64:
    """0 for a left or a top edge, whose centres are the triangle's own; else -1."""
    if step_x > wp.int64(0) or (step_x == wp.int64(0) and step_y < wp.int64(0)):
        return wp.int64(0)
    return wp.int64(-1)


@wp.func
def prepare(view: View, a: wp.vec3, b: wp.vec3, c: wp.vec3, rectangle: wp.vec4i) -> Fill:
    """Set up a triangle, seen from either side, over a rectangle of pixels."""
    fill = Fill()
    pa = snap(view, a)
    pb = snap(view, b)
    pc = snap(view, c)
    low = wp.min(pa, wp.min(pb, pc))
    high = wp.max(pa, wp.max(pb, pc))
    fill.first_column = wp.max(rectangle[0], first_centre(low[0]))
    fill.first_row = wp.max(rectangle[1], first_centre(low[1]))
    fill.rows = wp.min(rectangle[3], first_centre(high[1] + 1)) - fill.first_row
    columns = wp.min(rectangle[2], first_centre(high[0] + 1)) - fill.first_column
    turn = wp.sign(edge_function(pa, pb, pc[0], pc[1]))  # -1: seen from behind, all edge functions change sign
    if turn == wp.int64(0) or columns <= 0 or fill.rows <= 0:
        return fill
    x = fill.first_column * SUBPIXELS + CENTRE
    y = fill.first_row * SUBPIXELS + CENTRE
    side = turn * PIXEL_STEP
    fill.edge = turn * wp.vec3l(edge_function(pb, pc, x, y), edge_function(pc, pa, x, y), edge_function(pa, pb, x, y))
    fill.step_x = side * wp.vec3l(wp.int64(pb[1] - pc[1]), wp.int64(pc[1] - pa[1]), wp.int64(pa[1] - pb[1]))
    fill.step_y = side * wp.vec3l(wp.int64(pc[0] - pb[0]), wp.int64(pa[0] - pc[0]), wp.int64(pb[0] - pa[0]))
    missed = bool(False)
    for i in range(3):
        fill.bias[i] = edge_bias(fill.step_x[i], fill.step_y[i])
        fill.edge[i] += fill.bias[i]
        reach_x = wp.max(fill.step_x[i], wp.int64(0)) * wp.int64(columns - 1)
        reach_y = wp.max(fill.step_y[i], wp.int64(0)) * wp.int64(fill.rows - 1)
        missed = missed or fill.edge[i] + reach_x + reach_y < wp.int64(0)  # the whole rectangle lies off this edge
    if not missed:
        fill.columns = columns
    fill.weight = wp.vec3(
        1.0 / homogeneous_w(view, a[2]), 1.0 / homogeneous_w(view, b[2]), 1.0 / homogeneous_w(view, c[2])
    )
    fill.depth = wp.cw_mul(fill.weight, wp.vec3(a[2], b[2], c[2]))
    return fill


@wp.func
def fill_triangle(
    view: View, a: wp.vec3, b: wp.vec3, c: wp.vec3, rectangle: wp.vec4i, id: int, visibility_out: wp.array2d[wp.uint64]
):
    """Offer a triangle to the pixels of a rectangle inside the picture whose centres it covers.

    1 / w and Z / w are linear in the picture: their quotient is the depth, perspective-correct, and its weights are
    positive, so that it keeps float32's relative accuracy in a sliver too.
    """
    fill = prepare(view, a, b, c, rectangle)
    if fill.columns > 0:
        for j in range(fill.rows):
            edge = fill.edge + wp.int64(j) * fill.step_y
            for i in range(fill.columns):
                if (edge[0] | edge[1] | edge[2]) >= wp.int64(0):
                    share = wp.vec3(edge - fill.bias)
                    key = visibility_key(wp.dot(share, fill.depth) / wp.dot(share, fill.weight), id)
                    if (
                        key < visibility_out[fill.first_row + j, fill.first_column + i]
                    ):  # it only falls: spare the atomic
                        wp.atomic_min(visibility_out, fill.first_row + j, fill.first_column + i, key)
                edge += fill.step_x


@wp.func
def fill_polygon(
    view: View, polygon: Polygon, count: int, rectangle: wp.vec4i, id: int, visibility_out: wp.array2d[wp.uint64]
):
    """Offer a polygon to the pixels of a rectangle, as a fan of triangles."""
    for i in range(2, count):
        fill_triangle(view, polygon[0], polygon[i - 1], polygon[i], rectangle, id, visibility_out)


@wp.kernel(enable_backward=False)
def project_vertices_kernel(
    # In:
    begin: int,
    view: wp.array[View],
    vertices: wp.array[wp.vec3],
    # Out:
    screen_out: wp.array[wp.vec3],
):
    """Project one vertex [m] to homogeneous pixels. Launched over the vertices."""
    i = wp.tid() + begin
    screen_out[i] = project(view[0], vertices[i])


@wp.kernel(enable_backward=False)
def fill_small_kernel(
    # In:
    view: wp.array[View],
    screen: wp.array[wp.vec3],
    triangles: wp.array[wp.vec3i],
    # Out:
    visibility_out: wp.array2d[wp.uint64],
    large_out: wp.array[int],
    ends_out: wp.array[wp.int64],
    tally_out: wp.array[wp.uint64],
    dropped_out: wp.array[int],
):
    """Fill one triangle, or list it as large. Launched over the triangles.

    Entry k of the list is triangle ``large_out[k]``, whose blocks are the pieces up to ``ends_out[k]``. One atomic
    addition to ``tally_out[0]`` takes both the entry (high bits) and its pieces (low bits), so that the ends ascend.
    ``visibility_out`` is EMPTY before, ``tally_out`` and ``dropped_out`` are 0.
    """
    id = wp.tid()
    rows = visibility_out.shape[0]
    columns = visibility_out.shape[1]
    corners = triangles[id]
    if wp.min(corners) < 0 or wp.max(corners) >= screen.shape[0]:
        wp.atomic_add(dropped_out, BAD_INDEX, 1)
        return
    a = screen[corners[0]]
    b = screen[corners[1]]
    c = screen[corners[2]]
    if not (wp.isfinite(a) and wp.isfinite(b) and wp.isfinite(c)):
        wp.atomic_add(dropped_out, NOT_FINITE, 1)
        return
    polygon, count = visible_polygon(view[0], a, b, c, columns, rows)
    if count < 3:
        return
    rectangle = pixel_rectangle(view[0], polygon, count, columns, rows)
    width = rectangle[2] - rectangle[0]
    height = rectangle[3] - rectangle[1]
    if width <= 0 or height <= 0:
        return
    if width * height > BLOCK_PIXELS and list_entries(tally_out[0]) < large_out.shape[0]:
        pieces = wp.uint64(blocks(width) * blocks(height))
        before = wp.atomic_add(tally_out, 0, ONE_ENTRY + pieces)
        entry = list_entries(before)
        if entry < large_out.shape[0]:
            large_out[entry] = id
            ends_out[entry] = wp.int64(before % ONE_ENTRY + pieces)
            return
    fill_polygon(view[0], polygon, count, rectangle, id, visibility_out)


@wp.kernel(enable_backward=False)
def fill_large_kernel(
    # In:
    view: wp.array[View],
    screen: wp.array[wp.vec3],
    triangles: wp.array[wp.vec3i],
    large: wp.array[int],
    ends: wp.array[wp.int64],
    tally: wp.array[wp.uint64],
    workers: int,
    # Out:
    visibility_out: wp.array2d[wp.uint64],
):
    """Fill each `workers`-th block of the listed triangles. Launched over the workers, whatever the list holds."""
    rows = visibility_out.shape[0]
    columns = visibility_out.shape[1]
    entries = wp.min(list_entries(tally[0]), large.shape[0])
    piece = wp.int64(wp.tid())
    pieces = wp.int64(0)
    if entries > 0:
        pieces = ends[entries - 1]
    while piece < pieces:
        entry = wp.lower_bound(ends, 0, entries, piece + wp.int64(1))  # the first that ends after this piece
        start = wp.int64(0)
        if entry > 0:
            start = ends[entry - 1]
        id = large[entry]
        corners = triangles[id]
        polygon, count = visible_polygon(
            view[0], screen[corners[0]], screen[corners[1]], screen[corners[2]], columns, rows
        )
        rectangle = pixel_rectangle(view[0], polygon, count, columns, rows)
        fill_polygon(view[0], polygon, count, block_of(rectangle, int(piece - start)), id, visibility_out)
        piece += wp.int64(workers)
