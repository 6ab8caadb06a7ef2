"""Pictures of maps: y up, true scale bar, colours that mean what they say, no trace outside the file."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from warp_caustics.errors import InputError
from warp_caustics.png import INK, SMALLEST_SIDE, draw_map, scale_bar_length, write_png
from warp_caustics.tone import (
    COLOUR_MAP,
    NOT_FINITE_COLOUR,
    from_scale,
    to_rgb8,
    to_scale,
    value_limits,
)

PLACE = {"origin": (0.0, 0.0), "size": (4.0, 4.0), "units": "W/m²"}

SCALE_TOLERANCE = 1e-6
"""Of a place on the colour scale: float32 rounding, some of it through a difference of square roots."""

EXAMPLES = 40
"""Hypothesis examples of a whole picture, a few tens of milliseconds each."""


def magenta(picture: Image.Image) -> np.ndarray:
    """Where the picture shows values that are not finite, [rows from the top, columns]; nothing else is magenta."""
    return (np.asarray(picture) == NOT_FINITE_COLOUR).all(axis=2)


def marked(shape: tuple[int, ...], row: int, column: int) -> np.ndarray:
    """A map of ones with one NaN."""
    image = np.ones(shape, np.float32)
    image[row, column] = np.nan
    return image


@pytest.mark.parametrize("shape", [(4, 4), (3, 5), (4, 4, 3), (1, 2), (2, 1)])
def test_small_maps_are_enlarged_by_whole_pixels_and_row_0_is_at_the_bottom(shape):
    factor = -(-SMALLEST_SIDE // max(shape[:2]))
    corner = np.argwhere(magenta(draw_map(marked(shape, 0, 0), **PLACE)))
    opposite = np.argwhere(magenta(draw_map(marked(shape, -1, -1), **PLACE)))
    for block in (corner, opposite):
        assert len(block) == factor**2
        assert (block.max(axis=0) - block.min(axis=0) + 1).tolist() == [factor, factor]
    rows, columns = shape[:2]
    across = (corner - opposite)[0]
    assert across.tolist() == [(rows - 1) * factor, -(columns - 1) * factor]


@pytest.mark.parametrize("shape", [(520, 300), (300, 520, 3)])
def test_large_maps_are_drawn_pixel_for_pixel(shape):
    image = np.random.default_rng(0).random(shape, dtype=np.float32)
    image[0, 0] = np.nan
    picture = draw_map(image, **PLACE)
    ((bottom, left),) = np.argwhere(magenta(picture))
    rows, columns = shape[:2]
    drawn = np.asarray(picture)[bottom - rows + 1 : bottom + 1, left : left + columns]
    assert np.array_equal(drawn[::-1], to_rgb8(image, value_limits(image)))


def longest_run(row: np.ndarray) -> int:
    """Length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


@pytest.mark.parametrize(
    ("shape", "size", "length"),
    [
        ((512, 512), (4.0, 4.0), 1.0),
        ((300, 700), (7.0, 3.0), 2.0),
        ((8, 8), (0.02, 0.02), 0.005),
        ((600, 600), (4000.0, 4000.0), 1000.0),
        ((600, 600), (16.0, 4.0), 5.0),
        ((2, 1), (3.0, 6.0), 1.0),
    ],
)
def test_the_scale_bar_is_as_long_as_it_says(shape, size, length):
    assert scale_bar_length(size[0]) == length
    picture = np.asarray(draw_map(np.zeros(shape, np.float32), **PLACE | {"size": size}))
    ink = (picture == INK).all(axis=2)
    width = shape[1] * max(1, -(-SMALLEST_SIDE // max(shape)))
    assert max(longest_run(row) for row in ink) == round(length / size[0] * width)


@given(st.floats(1e-9, 1e9))
def test_scale_bars_are_round_and_no_longer_than_a_third(extent):
    length = scale_bar_length(extent)
    assert f"{length:.0e}"[0] in "125"
    assert float(f"{length:.0e}") == length
    assert extent / 3 / 2.5 * (1 - 1e-9) <= length <= extent / 3 * (1 + 1e-9)


def test_white_withstands_a_few_peaks_and_black_is_no_light():
    image = np.random.default_rng(0).random((100, 100), dtype=np.float32)
    low, high = value_limits(image)
    assert low == 0.0
    assert 0.99 < high < 1.0
    image[5, 5] = 1e20
    image[6, 6], image[6, 7], image[6, 8] = np.nan, np.inf, -np.inf
    assert value_limits(image) == pytest.approx((low, high), rel=1e-2)


def test_calm_water_is_shown_from_its_darkest():
    low, high = value_limits(1.0 + 0.1 * np.random.default_rng(0).random((50, 50)))
    assert 1.0 < low < 1.01
    assert 1.09 < high < 1.1


@pytest.mark.parametrize(
    ("image", "limits"),
    [
        (np.zeros((3, 3)), (0.0, 1.0)),
        (np.full((3, 3), -1.0), (0.0, 1.0)),
        (np.full((3, 3), np.nan), (0.0, 1.0)),
        (np.full((3, 3), 1e-42, np.float32), (0.0, 1.0)),
        (np.full((3, 3), 0.5), (0.0, 1.0)),
        (np.eye(1, 10**4), (0.0, 1.0)),
        (1.0 + np.arange(9.0).reshape(3, 3, 1) * np.ones(3) * 1e-1, (0.0, 1.8)),
    ],
    ids=["dark", "negative", "nan", "denormal", "uniform", "one lit pixel", "calm colour"],
)
def test_limits_of_special_maps(image, limits):
    assert value_limits(image) == pytest.approx(limits, rel=1e-2)


def test_the_uniform_map_is_neither_black_nor_white_nor_noise():
    image = np.ones((8, 8), np.float32)
    image[3, 3] += 1e-6
    colours = to_rgb8(image, value_limits(image)).reshape(-1, 3)
    assert len(np.unique(colours, axis=0)) == 1
    assert 50 < colours[0].mean() < 220


def test_the_colour_map_rises_in_lightness_all_the_way():
    colours = to_rgb8(from_scale(np.linspace(0, 1, 256)[None], 0.0, 3.0), (0.0, 3.0))[0] / 255.0
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    luminance = linear @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(luminance) > 0.0).all(), COLOUR_MAP


@given(place=st.floats(0, 1), low=st.floats(0, 10), span=st.floats(0.01, 1e6))
def test_the_scale_is_undone(place, low, span):
    value = from_scale(place, low, low + span)
    assert low * (1 - 1e-9) <= value <= (low + span) * (1 + 1e-9)
    assert abs(to_scale(value, low, low + span) - place) < SCALE_TOLERANCE


def test_three_channels_are_exposed_and_encoded_as_srgb():
    image = np.array([[[0.0, 1.0, 2.0], [0.5, 0.004, 9.0]]])
    # Of IEC 61966-2-1: 0.5 is 188, 0.25 is 137, 0.002 is 12.92 * 0.002 * 255 = 6.6.
    assert to_rgb8(image, (0.0, 2.0)).tolist() == [[[0, 188, 255], [137, 7, 255]]]


def test_given_limits_are_kept_so_that_a_sequence_does_not_flicker():
    bright, dim = np.full((600, 2), 2.0), np.full((600, 2), 1.0)
    pictures = [np.asarray(draw_map(image, **PLACE, limits=(0.0, 2.0))) for image in (bright, dim)]
    assert pictures[0].shape == pictures[1].shape
    assert not np.array_equal(*pictures)
    for bad in ((0.0, 0.0), (2.0, 1.0), (-1.0, 1.0), (0.0, np.inf), (np.nan, 1.0)):
        with pytest.raises(InputError, match="limits"):
            draw_map(bright, **PLACE, limits=bad)


@settings(max_examples=EXAMPLES, deadline=None)
@given(
    image=st.one_of(
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=9),
        st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(3)),
    ).flatmap(lambda shape: hnp.arrays(np.uint32, shape).map(lambda bits: bits.view(np.float32))),
    title=st.one_of(st.none(), st.text(max_size=20)),
    size=st.tuples(st.floats(1e-3, 1e5), st.floats(1e-3, 1e5)),
)
def test_any_bits_can_be_drawn_without_a_warning(image, title, size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = draw_map(image, origin=(1e5, -3.0), size=size, units="", title=title)
    assert picture.mode == "RGB"
    factor = -(-SMALLEST_SIDE // max(image.shape[:2]))
    bad = ~np.isfinite(image if image.ndim == 2 else image.sum(axis=2, dtype=np.float64))
    assert magenta(picture).sum() == bad.sum() * factor**2


def test_strides_do_not_matter():
    image = np.random.default_rng(0).random((6, 5), dtype=np.float32)
    reference = np.asarray(draw_map(image, **PLACE))
    for other in (np.asfortranarray(image), np.repeat(image, 2, axis=1)[:, ::2], image[::-1].copy()[::-1]):
        assert np.array_equal(np.asarray(draw_map(other, **PLACE)), reference)


def test_the_file_is_a_png_with_its_facts(tmp_path):
    write_png(tmp_path / "a.png", np.ones((3, 3), np.float32), **PLACE, title="pool", metadata={"Method": "beam"})
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.format == "PNG"
        assert picture.text == {"Software": "warp-caustics", "Title": "pool", "Units": "W/m²", "Method": "beam"}
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("shape", [(4,), (0, 3), (3, 3, 1), (3, 3, 4), (0, 0, 3)])
def test_what_is_no_map_is_refused_and_nothing_is_lost(tmp_path, shape):
    (tmp_path / "a.png").write_bytes(b"old")
    with pytest.raises(InputError, match="a map is"):
        write_png(tmp_path / "a.png", np.ones(shape, np.float32), **PLACE)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


@pytest.mark.parametrize("size", [(0.0, 1.0), (1.0, -1.0), (np.nan, 1.0), (1.0, np.inf)])
def test_a_map_without_extent_is_refused(size):
    with pytest.raises(InputError, match="size"):
        draw_map(np.ones((3, 3)), **PLACE | {"size": size})


def test_a_stop_while_the_picture_is_written_leaves_what_was_there(tmp_path, monkeypatch):
    def stop(self, path, **_):
        path.write_bytes(b"half a picture")
        raise KeyboardInterrupt

    (tmp_path / "a.png").write_bytes(b"old")
    monkeypatch.setattr(Image.Image, "save", stop)
    with pytest.raises(KeyboardInterrupt):
        write_png(tmp_path / "a.png", np.ones((3, 3)), **PLACE)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_drawing_leaves_no_trace_in_matplotlib(tmp_path):
    code = (
        "import sys, matplotlib, numpy as np; before = matplotlib.rcParams.copy()\n"
        "from warp_caustics.png import write_png\n"
        f"write_png({str(tmp_path / 'a.png')!r}, np.ones((3, 3)), origin=(0, 0), size=(1, 1), units='1')\n"
        "assert dict.__eq__(matplotlib.rcParams, before) and 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
