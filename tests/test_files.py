"""Whole files or none, checks before the work starts, names of sequences."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from warp_caustics.errors import InputError, RenderError
from warp_caustics.files import check_writable, frame_path, is_sequence, whole_file

OLD = b"what was there"
NEW = b"what is new"

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="needs folders that even root cannot write")
posix_only = pytest.mark.skipif(os.name != "posix", reason="needs POSIX files")


def test_whole_file_writes_beside_the_target_and_keeps_the_suffix(tmp_path):
    target = tmp_path / "map.exr"
    with whole_file(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".exr"
        assert temporary != target
        assert not target.exists()
        temporary.write_bytes(NEW)
    assert target.read_bytes() == NEW
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, ValueError, InputError, MemoryError])
@pytest.mark.parametrize("there_before", [False, True])
def test_whole_file_leaves_things_as_they_were_when_the_block_raises(tmp_path, error, there_before):
    target = tmp_path / "map.exr"
    if there_before:
        target.write_bytes(OLD)
    with pytest.raises(error), whole_file(target) as temporary:
        temporary.write_bytes(NEW)
        raise error
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [OLD] * there_before


def test_whole_file_reports_a_failure_of_the_disk_as_a_failure_not_as_bad_input(tmp_path):
    target = tmp_path / "map.exr"
    with pytest.raises(RenderError, match=r"map\.exr.*No space left"), whole_file(target):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_whole_file_survives_a_block_that_removed_its_file(tmp_path):
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "map.exr") as temporary:
        temporary.unlink()
        raise KeyboardInterrupt


def test_whole_file_replaces_an_existing_file(tmp_path):
    target = tmp_path / "map.exr"
    target.write_bytes(OLD)
    with whole_file(str(target)) as temporary:
        temporary.write_bytes(NEW)
        assert target.read_bytes() == OLD
    assert target.read_bytes() == NEW


@posix_only
def test_whole_file_gives_the_permissions_of_any_new_file(tmp_path):
    (tmp_path / "plain").touch()
    with whole_file(tmp_path / "whole"):
        pass
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode


@posix_only
def test_whole_file_writes_through_a_symbolic_link(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "link.exr"
    link.symlink_to(tmp_path / "real" / "map.exr")
    with whole_file(link) as temporary:
        temporary.write_bytes(NEW)
    assert link.is_symlink()
    assert (tmp_path / "real" / "map.exr").read_bytes() == NEW


@posix_only
def test_a_long_name_that_the_file_system_takes_is_taken(tmp_path):
    target = tmp_path / ("m" * 251 + ".exr")  # 255 bytes, the most that common file systems take
    check_writable(target)
    with whole_file(target) as temporary:
        temporary.write_bytes(NEW)
    assert target.read_bytes() == NEW


def test_check_writable_leaves_nothing_behind(tmp_path):
    check_writable(tmp_path / "map.exr")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "map.exr").write_bytes(OLD)
    check_writable(tmp_path / "map.exr")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [OLD]


def test_check_writable_takes_a_bare_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_writable("map.exr")


def _bad_paths(tmp_path: Path) -> dict[str, tuple[Path | str, str]]:
    """Paths that cannot be written, and what the message must say."""
    (tmp_path / "file").write_bytes(OLD)
    return {
        "missing folder": (tmp_path / "nowhere" / "map.exr", "nowhere.*does not exist"),
        "missing folders": (tmp_path / "no" / "where" / "map.exr", "where.*does not exist"),
        "file as folder": (tmp_path / "file" / "map.exr", "file.*is not a folder"),
        "folder": (tmp_path, "is a folder"),
        "empty": ("", "is a folder"),
        "null": ("a\0b", "null"),
    }


@pytest.mark.parametrize("case", ["missing folder", "missing folders", "file as folder", "folder", "empty", "null"])
def test_paths_that_cannot_be_written_are_refused(tmp_path, case):
    path, message = _bad_paths(tmp_path)[case]
    with pytest.raises(InputError, match=message):
        check_writable(path)
    with pytest.raises(InputError, match=message), whole_file(path):
        pytest.fail("the work began")
    assert (tmp_path / "file").read_bytes() == OLD


@linux_only
@pytest.mark.parametrize("folder", ["/proc", "/sys"])
def test_folders_that_not_even_root_can_write_are_refused(folder):
    with pytest.raises(InputError, match=f"'{folder}' cannot be written"):
        check_writable(f"{folder}/map.exr")


@posix_only
def test_a_pipe_is_refused_and_stays(tmp_path):
    pipe = tmp_path / "pipe.exr"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="device or a pipe"):
        check_writable(pipe)
    with pytest.raises(InputError, match="device or a pipe"), whole_file(pipe):
        pytest.fail("the work began")
    assert pipe.is_fifo()


@posix_only
def test_other_traps_of_posix_names_are_refused(tmp_path):
    loop = tmp_path / "loop.exr"
    loop.symlink_to(loop)
    too_long = tmp_path / ("m" * 300)
    for path in (loop, too_long):
        with pytest.raises(InputError, match="cannot write"):
            check_writable(path)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permission bits do not stop root")
def test_permissions_are_honoured(tmp_path):
    protected = tmp_path / "map.exr"
    protected.write_bytes(OLD)
    protected.chmod(0o444)
    with pytest.raises(InputError, match="write-protected"):
        check_writable(protected)
    tmp_path.chmod(0o555)
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / "other.exr")
    tmp_path.chmod(0o755)


@pytest.mark.parametrize(
    ("pattern", "index", "name"),
    [
        ("out.%04d.exr", 7, "out.0007.exr"),
        ("out.%d.exr", 12, "out.12.exr"),
        ("out.%02d.exr", 123, "out.123.exr"),
        ("%03d", 0, "000"),
        ("50%%_%04d.png", 3, "50%_0003.png"),
        ("a%%%d.png", 3, "a%3.png"),
    ],
)
def test_frames_are_numbered(pattern, index, name):
    assert is_sequence(pattern)
    assert frame_path(pattern, index) == Path(name)


def test_a_folder_is_no_pattern():
    assert frame_path(Path("100% %d %s") / "out.%04d.exr", 1) == Path("100% %d %s") / "out.0001.exr"
    assert not is_sequence("100% %d/out.exr")


@pytest.mark.parametrize(
    "pattern",
    [
        "out.exr",
        "out.%04d.%d.exr",
        "out.%s.exr",
        "out.%4d.exr",
        "out.%.exr",
        "out.%%d.exr",
        "out.%04f%d.exr",
        "%+d",
        "%0d",
    ],
)
def test_names_that_are_no_sequence_are_refused(pattern):
    with pytest.raises(InputError, match=r"out\.%04d\.exr"):
        frame_path(pattern, 0)


@pytest.mark.parametrize("name", ["out.exr", "100%.exr", "out.%%d.exr", "50%_d.exr"])
def test_plain_names_are_no_sequence(name):
    assert not is_sequence(name)


@pytest.mark.parametrize("name", ["out.%4d.exr", "out.%d.%d.exr"])
def test_a_sequence_that_is_spelt_wrongly_is_one_so_that_it_gets_its_message(name):
    assert is_sequence(name)


@given(
    st.text(alphabet="ab%d04s.- ", min_size=1).filter(lambda name: name.strip(".") and "/" not in name),
    st.integers(0, 10**6),
)
def test_any_name_gives_a_frame_or_a_message(name, index):
    try:
        path = frame_path(name, index)
    except InputError:
        return
    assert is_sequence(name)
    assert str(index) in path.name
