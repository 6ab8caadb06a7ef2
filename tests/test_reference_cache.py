"""References on disk: read back as they were, by content, and never half written."""

from __future__ import annotations

import numpy as np
import pytest
from scenery import GENTLE, sample_points, save_heights, scene

from warp_caustics.reference import make_reference
from warp_caustics.reference.cache import FOLDER_VARIABLE, load


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache"


LOOSE = 0.05  # enough to tell answers apart


def test_the_second_time_it_is_read(folder):
    first, second = (make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu") for _ in range(2))
    assert (first.cached, second.cached) == (False, True)
    np.testing.assert_array_equal(first.caustic_map, second.caustic_map)
    assert dict(first.energy) == dict(second.energy)
    assert (first.error_bar, first.samples, first.seconds) == (second.error_bar, second.samples, second.seconds)
    assert [path.suffix for path in folder.iterdir()] == [".npz"]


def test_without_the_cache_nothing_is_read_or_written(folder):
    assert not make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu", cache=False).cached
    assert not folder.exists()


def test_every_change_of_the_answer_has_an_entry_of_its_own(folder):
    changed = {
        "time": {"time": 1.0},
        "tolerance": {"tolerance": 2.0 * LOOSE},
    }
    make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu")
    for options in changed.values():
        assert not make_reference(scene(GENTLE), device="cpu", **{"tolerance": LOOSE, **options}).cached
    assert not make_reference(scene(GENTLE, level=1.1), tolerance=LOOSE, device="cpu").cached


def test_what_a_map_does_not_depend_on_has_not(folder):
    make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu")
    other = scene(GENTLE, method={"name": "photon"}).model_copy(update={"name": "another"})
    assert make_reference(other, tolerance=LOOSE, device="cpu").cached


def test_the_content_of_a_file_counts_not_its_name(folder, tmp_path):
    x, y = sample_points((12, 12), (-2.0, -2.0), (6.0, 6.0))
    made = []
    for turn in (0.0, 0.3):
        water = save_heights(tmp_path, "water", 0.01 * np.sin(x + y + turn), (-2.0, -2.0), (6.0, 6.0))
        made.append(make_reference(scene(height_map=water, resolution=(8, 6)), tolerance=LOOSE, device="cpu"))
    assert not made[1].cached
    assert not np.array_equal(made[0].caustic_map, made[1].caustic_map)


@pytest.mark.parametrize("content", [b"", b"not an archive", None])
def test_a_spoiled_entry_is_made_again(folder, content):
    first = make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu")
    (entry,) = folder.iterdir()
    entry.write_bytes(entry.read_bytes()[:-200] if content is None else content)
    again = make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu")
    assert not again.cached
    np.testing.assert_array_equal(first.caustic_map, again.caustic_map)
    assert make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu").cached


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    monkeypatch.setenv(FOLDER_VARIABLE, str(blocked / "cache"))
    assert not make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu").cached


def test_the_same_file_in_another_place_is_the_same(folder, tmp_path):
    z = 0.01 * np.random.default_rng(1).normal(size=(12, 12))
    for name, cached in (("one", False), ("two", True)):
        water = save_heights(tmp_path, name, z, (-2.0, -2.0), (6.0, 6.0))
        made = make_reference(scene(height_map=water, resolution=(8, 6)), tolerance=LOOSE, device="cpu")
        assert made.cached == cached


def test_the_shape_of_a_file_counts(folder, tmp_path):
    z, made = 0.01 * np.random.default_rng(1).normal(size=(8, 18)), []
    for shape in ((8, 18), (12, 12)):
        water = save_heights(tmp_path, "water", z.reshape(shape), (-2.0, -2.0), (6.0, 6.0))
        made.append(make_reference(scene(height_map=water, resolution=(8, 6)), tolerance=LOOSE, device="cpu"))
    assert not made[1].cached


def test_an_archive_of_something_else_is_made_again(folder):
    make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu")
    (entry,) = folder.iterdir()
    np.savez(entry, other=np.zeros(3))
    assert not make_reference(scene(GENTLE), tolerance=LOOSE, device="cpu").cached


def test_no_flipped_byte_brings_it_down(folder):
    made = make_reference(scene(GENTLE, resolution=(4, 3)), tolerance=LOOSE, device="cpu")
    (entry,) = folder.iterdir()
    whole = entry.read_bytes()
    for at in np.random.default_rng(2).integers(0, len(whole), 200):
        entry.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        load(entry.stem)  # raises nothing
    entry.write_bytes(whole)
    assert load(entry.stem)["error_bar"] == made.error_bar
