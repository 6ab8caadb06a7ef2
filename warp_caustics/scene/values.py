"""The kinds of value a scene holds: each says what it expects, in errors and in `docs/scene.md`, and checks it."""

from __future__ import annotations

import math
import numbers
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, GetCoreSchemaHandler, TypeAdapter, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from warp_caustics.scene.faults import did_you_mean, listed, quoted, refusal, shown
from warp_caustics.scene.formats import (
    HEIGHT_SUFFIXES,
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    PREFIXES,
    TEXTURE_SUFFIXES,
    suffix,
)

T = TypeVar("T")


class UnfitError(Exception):
    """A reader's value is not what it expects; the text, if any, is put behind "got ..."."""


@dataclass(frozen=True)
class Expects:
    """What a value must be, in words, and the reader that returns it in its own type or raises `UnfitError`."""

    text: str
    read: Callable[[Any], Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let pydantic call the reader in place of its own conversion, which would take "1" and True for numbers."""
        return core_schema.no_info_plain_validator_function(self.checked)

    def checked(self, value: Any) -> Any:
        """Return the value in its own type, or raise pydantic's exception with what was expected."""
        try:
            return self.read(value)
        except UnfitError as unfit:
            raise refusal(f"expected {self.text}, got {shown(value)}" + (f": {unfit}" if str(unfit) else "")) from None


@dataclass(frozen=True)
class Said:
    """What a value must be, in words alone: pydantic checks it by its type."""

    text: str


def finite(value: Any) -> float:
    """Return a real number as a float."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise UnfitError
    try:
        number = float(value)
    except OverflowError:
        raise UnfitError from None
    if not math.isfinite(number):
        raise UnfitError
    return number


def whole(value: Any) -> int:
    """Return a whole number as an int; a float is none, even when its fraction is zero."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        raise UnfitError
    return int(value)


def truth(value: Any) -> bool:
    """Return a truth value."""
    if not isinstance(value, (bool, np.bool_)):
        raise UnfitError
    return bool(value)


def text(value: Any) -> str:
    """Return a text that can be written to a file."""
    if not isinstance(value, str) or not value or "\0" in value:
        raise UnfitError
    try:
        value.encode()
    except UnicodeEncodeError:
        raise UnfitError("it is not Unicode text") from None
    return value


def that(read: Callable[[Any], T], fits: Callable[[T], bool], words: str) -> Expects:
    """Return what a reader expects, narrowed by a condition."""

    def narrowed(value: Any) -> T:
        result = read(value)
        if not fits(result):
            raise UnfitError
        return result

    return Expects(words, narrowed)


def one_of(
    *names: str, not_yet: tuple[str, ...] = (), other: Callable[[Any], Any] | None = None, or_else: str = ""
) -> Expects:
    """Return the expectation of one of several names.

    Parameters
    ----------
    names
        The names that are known.
    not_yet
        Names that a later version will know: refused as such.
    other, or_else
        A reader for what is not a text, and what it expects in words.
    """
    words = (f"one of {quoted(names)}" if len(names) > 1 else quoted(names)) + or_else

    def read(value: Any) -> Any:
        if isinstance(value, str):
            if value in names:
                return value
            if value in not_yet:
                raise UnfitError("not yet in this version")
            raise UnfitError(did_you_mean(value, (*names, *not_yet)) or "")
        if other is None:
            raise UnfitError
        return other(value)

    return Expects(words, read)


POSITIVE: Final = that(finite, lambda value: value > 0.0, "a finite number above 0")
COUNT: Final = that(whole, lambda value: value >= 1, "a whole number of at least 1")

Number = Annotated[float, Expects("a finite number", finite)]
Positive = Annotated[float, POSITIVE]
NonNegative = Annotated[float, that(finite, lambda value: value >= 0.0, "a finite number of at least 0")]
Index = Annotated[float, that(finite, lambda value: value >= 1.0, "a finite number of at least 1")]
Count = Annotated[int, COUNT]
Truth = Annotated[bool, Expects("true or false", truth)]
Text = Annotated[str, Expects("a text", text)]


def _items(count: int, words: str) -> BeforeValidator:
    """Return a validator that hands on `count` items, from a list, a tuple or a NumPy array."""

    def read(value: Any) -> tuple[Any, ...]:
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, (list, tuple)) or len(value) != count:
            raise refusal(f"expected {words}, got {shown(value)}")
        return tuple(value)

    return BeforeValidator(read)


_PAIR: Final = "[x, y], two finite numbers"
_TRIPLE: Final = "[x, y, z], three finite numbers"
_EXTENT: Final = "[x, y], two finite numbers above 0"
_BOX: Final = "[x, y, z], three finite numbers above 0"
_RESOLUTION: Final = "[columns, rows], two whole numbers of at least 1"
_RGB: Final = "[r, g, b], three finite numbers"

Pair = Annotated[tuple[Number, Number], Said(_PAIR), _items(2, _PAIR)]
Triple = Annotated[tuple[Number, Number, Number], Said(_TRIPLE), _items(3, _TRIPLE)]
Extent = Annotated[tuple[Positive, Positive], Said(_EXTENT), _items(2, _EXTENT)]
Box = Annotated[tuple[Positive, Positive, Positive], Said(_BOX), _items(3, _BOX)]
Resolution = Annotated[tuple[Count, Count], Said(_RESOLUTION), _items(2, _RESOLUTION)]

_NON_NEGATIVE_RGB: Final = TypeAdapter(Annotated[tuple[NonNegative, NonNegative, NonNegative], _items(3, _RGB)])
_INDEX_RGB: Final = TypeAdapter(Annotated[tuple[Index, Index, Index], _items(3, _RGB)])
_NON_NEGATIVE: Final = TypeAdapter(NonNegative)
_INDEX: Final = TypeAdapter(Index)
Share = Annotated[float, that(finite, lambda value: 0.0 <= value <= 1.0, "a finite number from 0 to 1")]
_SHARE_RGB: Final = TypeAdapter(Annotated[tuple[Share, Share, Share], _items(3, _RGB)])
_SHARE: Final = TypeAdapter(Share)


def by_channel(number: TypeAdapter[float], rgb: TypeAdapter[tuple[float, float, float]], words: str) -> Expects:
    """Return the expectation of one number or one for each channel; a fault keeps its place in the list."""

    def read(value: Any) -> float | tuple[float, float, float]:
        if isinstance(value, (list, tuple, np.ndarray)):
            return rgb.validate_python(value)
        if isinstance(value, (str, Mapping)) or value is None:
            raise UnfitError
        return number.validate_python(value)

    return Expects(words, read)


_COLOUR: Final = by_channel(_NON_NEGATIVE, _NON_NEGATIVE_RGB, "a finite number of at least 0, or [r, g, b] of them")
_ALBEDO: Final = by_channel(_SHARE, _SHARE_RGB, "a finite number from 0 to 1, or [r, g, b] of them")
_IOR: Final = by_channel(_INDEX, _INDEX_RGB, "")

Colour = Annotated[float | tuple[float, float, float], _COLOUR]
Albedo = Annotated[float | tuple[float, float, float], _ALBEDO]
Ior = Annotated[
    float | tuple[float, float, float] | str,
    one_of("fresh", "sea", other=_IOR.read, or_else=", a finite number of at least 1, or [r, g, b] of them"),
]


def _file_name(suffixes: tuple[str, ...]) -> Callable[[Any], str]:
    """Return a reader of file names with one of these suffixes."""

    def read(value: Any) -> str:
        name = text(os.fspath(value) if isinstance(value, os.PathLike) else value)
        if suffix(name) not in suffixes:
            raise UnfitError
        return name

    return read


def _beside_scene(name: str, info: ValidationInfo) -> str:
    """Return a file's name, made absolute when a scene file is being loaded: its folder is the context."""
    if name.startswith(PREFIXES) or not info.context:
        return name
    folder: Path = info.context["folder"]
    return str(folder / name)


HeightPath = Annotated[
    str,
    Expects(f"a file that ends in {listed(HEIGHT_SUFFIXES)}", _file_name(HEIGHT_SUFFIXES)),
    AfterValidator(_beside_scene),
]
MeshPath = Annotated[
    str,
    Expects(f"a file that ends in {listed(MESH_SUFFIXES)}", _file_name(MESH_SUFFIXES)),
    AfterValidator(_beside_scene),
]
TexturePath = Annotated[
    str,
    Expects(f"a file that ends in {listed(TEXTURE_SUFFIXES)}", _file_name(TEXTURE_SUFFIXES)),
    AfterValidator(_beside_scene),
]
ImagePath = Annotated[
    str,
    Expects(f"a file that ends in {listed(IMAGE_SUFFIXES)}", _file_name(IMAGE_SUFFIXES)),
    AfterValidator(_beside_scene),
]
