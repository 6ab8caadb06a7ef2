"""A map as a picture to look at: coloured, y up, with a scale bar in metres and a colour bar."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from warp_caustics.errors import InputError
from warp_caustics.files import whole_file
from warp_caustics.tone import RGB, from_scale, is_colour, to_rgb8, to_scale, value_limits

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont
    from PIL.PngImagePlugin import PngInfo

SMALLEST_SIDE = 512
"""The longer side of a map has at least so many pixels in the picture: a smaller map is enlarged by a whole factor."""

SMALLEST_TEXT = 13
"""Height of the letters [pixels] where the map is no larger than it must be."""

TEXT_SHARE = 1 / 40
"""Height of the letters over the longer side: on a large picture they grow, since it is looked at from further off."""

SCALE_BAR_SHARE = 1 / 3
"""The scale bar is the longest round length that is no longer than this share of the map."""

SHORTEST_COLOUR_BAR = 8
"""In heights of a letter, so that labels keep apart on a map of few rows."""

MOST_TICKS = 6
SQUARE_PIXELS = 0.01
"""Relative difference of a pixel's sides up to which one scale bar serves both axes."""

# Lengths of the layout, in heights of a letter.
MARGIN = 1.25
GAP = 0.75
BAR_WIDTH = 1.0
TICK = 0.35
LINE = 1.5
TITLE_LINE = 2.0

BACKGROUND = (13, 19, 28)
INK = (229, 235, 242)
FAINT_INK = (148, 163, 180)
FRAME = (62, 75, 92)


def write_png(
    path: str | os.PathLike[str],
    image: npt.NDArray[np.floating[Any]],
    *,
    origin: Sequence[float],
    size: Sequence[float],
    units: str,
    title: str | None = None,
    limits: tuple[float, float] | None = None,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write a map as a picture, whole or not at all.

    Parameters
    ----------
    path
        The PNG file to write, in a folder that exists.
    image
        [rows, columns] or [rows, columns, 3], row 0 at the origin; it is drawn at the bottom.
    origin, size
        Lower corner and extent of the map, (x, y) [m].
    units
        Units of the values, such as "W/m²".
    title
        A line above the map.
    limits
        Values shown as black and as white; by default `warp_caustics.tone.value_limits` of this map.
    metadata
        Texts to keep in the file, by name, such as the method and the time.

    Raises
    ------
    InputError
        `image` is no map, or `path` cannot be written.
    RenderError
        Writing failed although it had begun: the disk is full, for example.
    """
    picture = draw_map(image, origin=origin, size=size, units=units, title=title, limits=limits)
    known = {"Software": "warp-caustics", "Title": title or "", "Units": units}
    with whole_file(path) as temporary:
        picture.save(temporary, format="PNG", pnginfo=_texts({**known, **(metadata or {})}))


def write_picture(
    path: str | os.PathLike[str], pixels: npt.NDArray[np.uint8], metadata: Mapping[str, str] | None = None
) -> None:
    """Write a picture with nothing beside its pixels, whole or not at all.

    Parameters
    ----------
    path
        The PNG file to write, in a folder that exists.
    pixels
        uint8 sRGB [rows, columns, 3], or grey [rows, columns], row 0 at the bottom.
    metadata
        Texts to keep in the file, by name.
    """
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(pixels[::-1]))
    with whole_file(path) as temporary:
        picture.save(temporary, format="PNG", pnginfo=_texts({"Software": "warp-caustics", **(metadata or {})}))


def _texts(texts: Mapping[str, str]) -> PngInfo:
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    for name, text in texts.items():
        if text:
            info.add_itxt(name, text)
    return info


def draw_map(
    image: npt.NDArray[np.floating[Any]],
    *,
    origin: Sequence[float],
    size: Sequence[float],
    units: str,
    title: str | None = None,
    limits: tuple[float, float] | None = None,
) -> Image.Image:
    """Draw the picture that `write_png` writes; the parameters are its own."""
    from PIL import Image, ImageDraw

    if not all(math.isfinite(side) and side > 0.0 for side in size):
        raise InputError(f"the size of a map must be two lengths above zero [m], not {tuple(size)}")
    if limits is not None and not 0.0 <= limits[0] < limits[1] < math.inf:
        raise InputError(f"the limits of a picture must be two values with 0 <= low < high, not {tuple(limits)}")
    shown_limits = limits or value_limits(image)
    rows, columns = image.shape[:2]
    coloured = Image.fromarray(np.ascontiguousarray(to_rgb8(image, shown_limits)[::-1]))
    factor = -(-SMALLEST_SIDE // max(rows, columns))
    width, height = columns * factor, rows * factor
    letter = max(SMALLEST_TEXT, round(TEXT_SHARE * max(width, height)))
    font = _font(letter)
    captions = _captions(image, shown_limits, origin, size, units)
    title = " ".join(title.split()) if title else ""

    def em(count: float) -> int:
        return round(count * letter)

    bar = _draw_colour_bar(is_colour(image), shown_limits, units, max(height, em(SHORTEST_COLOUR_BAR)), letter)
    left, top = em(MARGIN), em(MARGIN) + (em(TITLE_LINE) if title else 0)
    text_width = max(math.ceil(font.getlength(text)) for text in (*captions, title))
    under = top + max(height, bar.height - letter) + em(GAP)
    canvas = Image.new(
        "RGB",
        (
            left + max(width + em(GAP) + bar.width, text_width) + em(MARGIN),
            under + em(LINE) * (1 + len(captions)) + em(MARGIN - 0.25),
        ),
        BACKGROUND,
    )
    draw = ImageDraw.Draw(canvas)
    if title:
        draw.text((left, em(MARGIN)), title, INK, _font(letter, bold=True), anchor="lt")
    draw.rectangle((left - 1, top - 1, left + width, top + height), outline=FRAME)
    canvas.paste(coloured.resize((width, height), Image.Resampling.NEAREST), (left, top))
    canvas.paste(bar, (left + width + em(GAP), top - letter // 2))
    _draw_scale_bar(draw, (left, under), size, (columns, rows), factor, letter)
    for i, text in enumerate(captions):
        draw.text((left, under + em(LINE) * (i + 1)), text, FAINT_INK, font, anchor="lt")
    return canvas


def scale_bar_length(extent: float) -> float:
    """Longest of 1, 2, 5 times a power of ten that is at most a third of `extent`, in the units of `extent`."""
    return _round_down(extent * SCALE_BAR_SHARE)


def _round_down(value: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that does not pass `value`, give or take rounding."""
    exponent = math.floor(math.log10(value))
    # Through text, since 2 * 10.0**-3 and 0.002 may differ in the last bit, and a neighbouring power may be the one.
    rounds = [float(f"{digit}e{exponent + step}") for step in (-1, 0, 1) for digit in (1, 2, 5)]
    return max(length for length in rounds if length <= value * (1.0 + 1e-9))


def _ticks(low: float, high: float) -> list[float]:
    """Round values from `low` to `high`, at most `MOST_TICKS` of them."""
    step = _round_down((high - low) / MOST_TICKS)
    while math.floor(high / step) - math.ceil(low / step) + 1 > MOST_TICKS:
        step = _round_down(2.5 * step)  # the next in 1, 2, 5, 10
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _captions(
    image: npt.NDArray[Any], limits: tuple[float, float], origin: Sequence[float], size: Sequence[float], units: str
) -> list[str]:
    """Lines under the map: where it is, and how its values became colours."""
    low, high = limits
    rows, columns = image.shape[:2]
    brightest = image.max(axis=2) if is_colour(image) else image
    within = np.count_nonzero((brightest >= low) & (brightest <= high)) / brightest.size
    if is_colour(image):
        tone = f"sRGB, exposure {1.0 / high:.3g}: white at {high:.3g}"
    else:
        tone = f"square-root scale from {low:.3g} to {high:.3g}"
    lines = [
        f"{size[0]:g} × {size[1]:g} m, lower corner ({origin[0]:.10g}, {origin[1]:.10g}) m, {columns} × {rows} pixels",
        f"{tone} [{units}], {within:.1%} of the pixels within",
    ]
    bad = np.count_nonzero(~np.isfinite(brightest))
    return [*lines, f"in magenta, not finite: {bad}"] if bad else lines


def _draw_scale_bar(
    draw: ImageDraw.ImageDraw,
    corner: tuple[int, int],
    size: Sequence[float],
    resolution: tuple[int, int],
    factor: int,
    letter: int,
) -> None:
    """Draw a bar of a round length along x, its length beside it, from `corner` (left, top)."""
    length = scale_bar_length(size[0])
    across, up = size[0] / resolution[0], size[1] / resolution[1]
    pixels = max(1, round(length / across * factor))
    thickness = max(2, round(0.3 * letter))
    x, y = corner[0], corner[1] + (letter - thickness) // 2
    draw.rectangle((x, y, x + pixels - 1, y + thickness - 1), fill=INK)
    label = f"{length:g} m" if abs(across / up - 1.0) <= SQUARE_PIXELS else f"{length:g} m along x"
    draw.text((x + pixels + letter // 2, corner[1] + letter // 2), label, INK, _font(letter), anchor="lm")


def _draw_colour_bar(colour: bool, limits: tuple[float, float], units: str, height: int, letter: int) -> Image.Image:
    """Draw the upright bar with ticks, numbers and units; half a letter stands over at both ends for the numbers."""
    from PIL import Image, ImageDraw

    font = _font(letter)
    ticks = _ticks(*limits)
    labels = [f"{tick:.6g}" for tick in ticks]
    ramp = from_scale((np.arange(height)[::-1, None] + 0.5) / height, *limits)
    if colour:
        ramp = np.repeat(ramp[..., None], RGB, axis=2)
    bar_width, tick_width, half = round(BAR_WIDTH * letter), round(TICK * letter), letter // 2
    label_width = max(math.ceil(font.getlength(label)) for label in labels)
    unit_text = _upright_text(units, letter)
    text_left = bar_width + tick_width + letter // 4
    width = text_left + label_width + letter // 2 + unit_text.width
    canvas = Image.new("RGB", (width, height + 2 * half), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    canvas.paste(Image.fromarray(to_rgb8(ramp, limits)).resize((bar_width, height)), (0, half))
    draw.rectangle((0, half - 1, bar_width - 1, half + height), outline=FRAME)
    for tick, label in zip(ticks, labels, strict=True):
        y = half + round((1.0 - float(to_scale(tick, *limits))) * (height - 1))
        draw.line((bar_width, y, bar_width + tick_width, y), fill=FAINT_INK, width=max(1, letter // 13))
        draw.text((text_left, y), label, INK, font, anchor="lm")
    if unit_text.height <= canvas.height:  # else the line under the map, which names them too, must do
        canvas.paste(unit_text, (width - unit_text.width, (canvas.height - unit_text.height) // 2))
    return canvas


def _upright_text(text: str, letter: int) -> Image.Image:
    """Text that reads from bottom to top."""
    from PIL import Image, ImageDraw

    font = _font(letter)
    line = Image.new("RGB", (max(1, math.ceil(font.getlength(text))), round(LINE * letter)), BACKGROUND)
    ImageDraw.Draw(line).text((0, line.height // 2), text, FAINT_INK, font, anchor="lm")
    return line.transpose(Image.Transpose.ROTATE_90)


@functools.cache
def _font(letter: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Load the DejaVu Sans that matplotlib brings along, `letter` pixels high; it has ², × and Greek."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), letter)
