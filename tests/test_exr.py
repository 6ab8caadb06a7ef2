"""Maps come back from EXR bit for bit; damaged files are refused; the traps of OpenEXR's binding are pinned."""

from __future__ import annotations

import math
import os

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from warp_caustics.errors import InputError, RenderError
from warp_caustics.exr import load_header, load_map, read_exr, write_map

FACTS = {
    "scene_text": "[water]\nlevel = 2.0  # é\n",
    "version": "1.2.3",
    "method": "beam",
    "units": "W/m²",
    "origin": (1e5 + 0.1, -0.3),
    "size": (4.1, 2.7),
    "energy": {"emitted": 1.1, "received": np.array([0.1, 0.2, 0.3]), "dry": np.float64(1e-300)},
    "time": 0.1,
}

EXAMPLES = 60
"""Hypothesis examples of a round trip: each writes a file, a few milliseconds."""

SMALL_DISK = 2000
"""Bytes that a file may have in the test of a full disk: more than the header, less than the pixels."""

LAYOUTS = {
    "c": lambda a: a,
    "fortran": lambda a: np.asfortranarray(a),
    "flipped rows": lambda a: a[::-1].copy()[::-1],
    "flipped columns": lambda a: a[:, ::-1].copy()[:, ::-1],
    "every other row": lambda a: np.repeat(a, 2, axis=0)[::2],
    "every other column": lambda a: np.repeat(a, 2, axis=1)[:, ::2],
    "transposed": lambda a: np.ascontiguousarray(a.swapaxes(0, 1)).swapaxes(0, 1),
    "read-only": lambda a: np.frombuffer(a.tobytes(), a.dtype).reshape(a.shape),
    "unaligned": lambda a: np.frombuffer(b"x" + a.tobytes(), a.dtype, offset=1).reshape(a.shape),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder for the files of all examples of a hypothesis test, one after the other."""
    return tmp_path_factory.mktemp("exr")


def same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal in shape, type and every bit, so that NaN equals itself and minus zero is not zero."""
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def any_floats(shape: tuple[int, ...]) -> st.SearchStrategy[np.ndarray]:
    """Float32 of any bits: every NaN payload, denormal, infinity and zero there is."""
    return hnp.arrays(np.uint32, shape).map(lambda bits: bits.view(np.float32))


sides = st.integers(1, 19)  # ZIP packs 16 rows to a chunk: one chunk and two, full and not
shapes = st.one_of(st.tuples(sides, sides), st.tuples(sides, sides, st.just(3)))
maps = shapes.flatmap(any_floats)


@settings(max_examples=EXAMPLES, deadline=None)
@given(image=maps, layout=st.sampled_from(sorted(LAYOUTS)))
def test_a_map_comes_back_bit_for_bit(folder, image, layout):
    given_image = LAYOUTS[layout](image)
    assert same_bits(np.array(given_image, order="C"), image)
    write_map(folder / "map.exr", given_image, **FACTS)
    back = load_map(folder / "map.exr")
    assert same_bits(back, image)
    assert back.flags.c_contiguous
    assert back.flags.writeable


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 33), (33, 1), (1, 1, 3), (1, 33, 3), (33, 1, 3), (3, 3), (3, 3, 3), (257, 131)]
)
@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_each_layout_of_each_shape_comes_back(tmp_path, shape, layout):
    image = np.random.default_rng(1).random(shape, dtype=np.float32)
    write_map(tmp_path / "map.exr", LAYOUTS[layout](image), **FACTS)
    assert same_bits(load_map(tmp_path / "map.exr"), image)


def test_special_values_come_back(tmp_path):
    bits = [0x7FC00000, 0x7F800001, 0xFFC12345, 0x7F800000, 0xFF800000, 1, 0x80000000, 0x007FFFFF, 0x7F7FFFFF]
    image = np.array(bits, dtype=np.uint32).view(np.float32).reshape(3, 3)
    write_map(tmp_path / "map.exr", image, **FACTS)
    assert load_map(tmp_path / "map.exr").view(np.uint32).ravel().tolist() == bits


def test_the_file_is_y_up_and_says_so(tmp_path):
    image = np.array([[1, 2], [3, 4], [5, 6]], dtype=np.float32)
    write_map(tmp_path / "map.exr", image, **FACTS)
    with OpenEXR.File(str(tmp_path / "map.exr")) as exr:
        assert exr.channels()["Y"].pixels.tolist() == [[5, 6], [3, 4], [1, 2]]
        assert "last row first" in exr.header()["rowOrder"]
        assert exr.header()["compression"] == OpenEXR.ZIP_COMPRESSION
        assert list(exr.channels()) == ["Y"]


def test_colours_are_the_channels_r_g_b(tmp_path):
    image = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    write_map(tmp_path / "map.exr", image, **FACTS)
    with OpenEXR.File(str(tmp_path / "map.exr"), separate_channels=True) as exr:
        assert sorted(exr.channels()) == ["B", "G", "R"]
        assert all(channel.pixels.dtype == np.float32 for channel in exr.channels().values())
        assert exr.channels()["G"].pixels.tolist() == image[::-1, :, 1].tolist()


def test_the_header_tells_what_made_the_map_in_double_precision(tmp_path):
    write_map(tmp_path / "map.exr", np.ones((2, 3), np.float32), **FACTS)
    header = load_header(tmp_path / "map.exr")
    assert header["rowOrder"] == "y-up: last row first"
    assert header["scene"] == FACTS["scene_text"]
    assert header["software"] == "warp-caustics 1.2.3"
    assert header["method"] == "beam"
    assert header["units"] == "W/m²"
    assert header["origin"] == FACTS["origin"]
    assert header["size"] == FACTS["size"]
    assert header["time"] == FACTS["time"]
    assert header["energy"] == {"emitted": 1.1, "received": (0.1, 0.2, 0.3), "dry": 1e-300}


def test_a_map_without_its_attributes_still_loads(tmp_path):
    pixels = np.array([[5, 6], [3, 4]], dtype=np.float32)
    write_exr(tmp_path / "map.exr", {"Y": pixels})
    assert load_map(tmp_path / "map.exr").tolist() == [[3, 4], [5, 6]]
    assert load_header(tmp_path / "map.exr")["energy"] == {}


@pytest.mark.parametrize(
    "image",
    [
        np.ones((2, 2), np.float64),
        np.ones((2, 2), np.float16),
        np.ones((2, 2), ">f4"),
        np.ones((2, 2, 1), np.float32),
        np.ones((2, 2, 4), np.float32),
        np.ones(4, np.float32),
        np.ones((0, 2), np.float32),
        np.ones((2, 0, 3), np.float32),
    ],
    ids=lambda image: f"{image.dtype.str}{image.shape}",
)
def test_what_is_no_map_is_refused_before_a_file_is_touched(tmp_path, image):
    (tmp_path / "map.exr").write_bytes(b"old")
    with pytest.raises(InputError, match="a map"):
        write_map(tmp_path / "map.exr", image, **FACTS)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


@pytest.mark.parametrize("there_before", [False, True])
def test_a_failure_of_the_binding_leaves_nothing_behind(tmp_path, there_before):
    if there_before:
        (tmp_path / "map.exr").write_bytes(b"old")
    with pytest.raises(RuntimeError):  # no attribute of EXR holds five numbers
        write_map(tmp_path / "map.exr", np.ones((2, 2), np.float32), **FACTS | {"energy": {"emitted": [1.0] * 5}})
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"] * there_before


def test_a_full_disk_is_a_failure_that_destroys_nothing(tmp_path):
    resource = pytest.importorskip("resource")
    (tmp_path / "map.exr").write_bytes(b"old")
    image = np.random.default_rng(0).random((64, 64), dtype=np.float32)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL_DISK, hard))
    try:
        with pytest.raises(RenderError, match=r"cannot write.*map\.exr"):
            write_map(tmp_path / "map.exr", image, **FACTS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_a_missing_folder_is_bad_input(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.*does not exist"):
        write_map(tmp_path / "nowhere" / "map.exr", np.ones((2, 2), np.float32), **FACTS)


def write_exr(path, channels, **attributes) -> None:
    """Write any EXR with the binding itself."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    with OpenEXR.File(header, channels) as exr:
        exr.write(str(path))


ones = np.ones((2, 2), np.float32)


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        ({"Z": ones}, "Z"),
        ({"R": ones, "G": ones}, "R, G|G .*R"),
        ({"R": ones, "G": ones, "B": ones, "A": ones}, "A"),
        ({"R": ones, "G": ones, "Y": ones}, "Y"),
        ({"Y": ones.astype(np.float16)}, "float16"),
        ({"Y": ones.astype(np.uint32)}, "uint32"),
        ({"R": ones, "G": ones.astype(np.float16), "B": ones}, "float16"),
    ],
    ids=str,
)
def test_other_channels_are_refused(tmp_path, channels, message):
    write_exr(tmp_path / "other.exr", channels)
    with pytest.raises(InputError, match=f"(?s)is not a map.*({message}).*expected float32 Y, or R, G, B"):
        load_map(tmp_path / "other.exr")


@pytest.mark.parametrize("order", ["y-down", 3, np.array([1.0, 2.0])], ids=str)
def test_another_order_of_rows_is_refused(tmp_path, order):
    write_exr(tmp_path / "other.exr", {"Y": ones}, rowOrder=order)
    with pytest.raises(InputError, match="rowOrder"):
        load_map(tmp_path / "other.exr")


def test_several_parts_are_refused(tmp_path):
    with OpenEXR.File([OpenEXR.Part({"name": name}, {"Y": ones}) for name in "ab"]) as exr:
        exr.write(str(tmp_path / "parts.exr"))
    with pytest.raises(InputError, match="2 parts"):
        load_map(tmp_path / "parts.exr")


def test_missing_files_folders_and_other_files_are_refused(tmp_path):
    (tmp_path / "other.exr").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (tmp_path / "empty.exr").touch()
    for path, message in {
        "nosuch.exr": "nosuch.exr.*No such file",
        "": "directory|Permission",
        "other.exr": "other.exr.*is not an OpenEXR file",
        "empty.exr": "empty.exr.*is not an OpenEXR file",
        "other.exr/map.exr": "map.exr.*directory",
        "a\0b": "null",
    }.items():
        for read in (load_map, load_header):
            with pytest.raises(InputError, match=message):
                read(os.path.join(tmp_path, path))  # noqa: PTH118 (a null character is meant to get through)


@pytest.fixture(scope="module")
def whole_exr(folder) -> bytes:
    """The bytes of a map of three channels and three chunks."""
    image = np.random.default_rng(0).random((40, 30, 3), dtype=np.float32)
    write_map(folder / "whole.exr", image, **FACTS)
    return (folder / "whole.exr").read_bytes()


@settings(max_examples=EXAMPLES, deadline=None)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_truncated_file_is_refused(folder, whole_exr, share):
    (folder / "cut.exr").write_bytes(whole_exr[: math.floor(share * len(whole_exr))])
    with pytest.raises(InputError, match=r"cut\.exr"):
        load_map(folder / "cut.exr")


def test_a_truncated_file_is_refused_without_a_word_from_the_decoder(folder, whole_exr, capfd):
    for missing in (1, 2, 5000, len(whole_exr) - 2000, len(whole_exr) - 700, len(whole_exr) - 20):
        (folder / "cut.exr").write_bytes(whole_exr[:-missing])
        with pytest.raises(InputError, match="is cut short"):
            load_map(folder / "cut.exr")
    assert tuple(capfd.readouterr()) == ("", "")


def test_a_file_without_its_table_of_chunks_is_refused(folder, whole_exr):
    """The table is written last: a writer that was stopped leaves zeros there."""
    table = whole_exr.index(b"type\0string") + len(b"type\0string\0") + 4 + len("scanlineimage")
    table = whole_exr.index(b"units\0string\0", table) + len(b"units\0string\0") + 4 + len("W/m²".encode()) + 1
    stopped = whole_exr[:table] + bytes(3 * 8) + whole_exr[table + 3 * 8 :]
    (folder / "stopped.exr").write_bytes(stopped)
    with pytest.raises(InputError, match="is cut short"):
        load_map(folder / "stopped.exr")


def test_damaged_pixels_are_refused(folder):
    """ZIP carries a checksum where it could pack; pixels of pure noise it stores as they are, without one."""
    write_map(folder / "damaged.exr", np.add.outer(np.arange(64), np.arange(64)).astype(np.float32), **FACTS)
    data = bytearray((folder / "damaged.exr").read_bytes())
    data[-20] ^= 0x55
    (folder / "damaged.exr").write_bytes(data)
    with pytest.raises(InputError, match="is damaged"):
        load_map(folder / "damaged.exr")


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "DWAB"])
@pytest.mark.parametrize("rows", [1, 16, 17, 300])
def test_whole_files_of_other_programs_are_not_taken_for_cut_short(tmp_path, compression, rows):
    pixels = np.zeros((rows, 5), np.float32)
    write_exr(tmp_path / "other.exr", {"z": pixels}, compression=getattr(OpenEXR, f"{compression}_COMPRESSION"))
    _, channels = read_exr(tmp_path / "other.exr")
    assert channels["z"].tolist() == pixels.tolist()


@pytest.mark.parametrize("extra", [{"lineOrder": OpenEXR.DECREASING_Y}, {"type": OpenEXR.tiledimage}], ids=str)
def test_files_laid_out_in_another_way_are_read(tmp_path, extra):
    pixels = np.arange(70 * 5, dtype=np.float32).reshape(70, 5)
    if "type" in extra:
        extra = extra | {"tiles": OpenEXR.TileDescription()}
    write_exr(tmp_path / "other.exr", {"Y": pixels}, **extra)
    assert load_map(tmp_path / "other.exr").tolist() == pixels[::-1].tolist()


# What follows pins OpenEXR's binding itself: when one of these goes red, the binding has changed, and the care that
# warp_caustics/exr.py takes over it may be taken out.


@pytest.mark.parametrize("layout", ["fortran", "flipped rows", "flipped columns", "every other column", "transposed"])
def test_pin_the_binding_writes_strided_arrays_wrongly(tmp_path, layout):
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    write_exr(tmp_path / "pin.exr", {"Y": LAYOUTS[layout](pixels)})
    with OpenEXR.File(str(tmp_path / "pin.exr")) as exr:
        assert exr.channels()["Y"].pixels.tolist() != pixels.tolist()


def test_pin_the_binding_reads_past_the_end_of_one_channel_arrays(tmp_path):
    """[rows, columns, 1] is taken for three channels, each one float further on, so the last two end past the array."""
    memory = np.arange(22, dtype=np.float32)  # the array is the first 20, so that what is past its end is known
    write_exr(tmp_path / "pin.exr", {"Y": memory[:20].reshape(4, 5, 1)})
    with OpenEXR.File(str(tmp_path / "pin.exr"), separate_channels=True) as exr:
        last = {name: float(channel.pixels[-1, -1]) for name, channel in exr.channels().items()}
    assert last == {"Y.R": 19.0, "Y.G": 20.0, "Y.B": 21.0}


def test_pin_the_binding_opens_a_truncated_file_as_one_with_no_parts(folder, whole_exr, capfd):
    (folder / "pin.exr").write_bytes(whole_exr[:-1])
    with OpenEXR.File(str(folder / "pin.exr"), separate_channels=True) as exr:
        assert len(exr.parts) == 0
    printed = capfd.readouterr()
    assert "corrupt" in printed.err  # which is why _is_cut_short looks first
    assert "Warning" in printed.out


def test_pin_the_binding_rounds_python_floats_and_loses_a_text_named_version(tmp_path):
    write_exr(tmp_path / "pin.exr", {"Y": ones}, number=0.1, version="1.2.3")
    with OpenEXR.File(str(tmp_path / "pin.exr")) as exr:
        assert exr.header()["number"] == float(np.float32(0.1))
        assert "version" not in exr.header()
