"""The forms of the splat against overlaps in float64, on hard landings; fixed point bit for bit; runs of columns."""

from importlib import import_module

import numpy as np
import pytest
from kernel_helpers import rounded
from ladder_splat import rungs
from scenery import GENTLE, save_heights, scene
from splat_rungs.landed import land, make_frame
from splat_rungs.merged import merged
from splat_rungs.plain import each_channel, plain
from splat_rungs.tiles import BATCH, PATCH, TILE, binned, make_private_patches, private_tiles
from splat_rungs.vector import quads, rgba

import warp_caustics as wc
from warp_caustics import lattice_recording
from warp_caustics.kernels.deposit import unit

RESOLUTION = (45, 38)  # no multiple of a tile
ACROSS = 2 * PATCH  # photons in a row of their lattice
# Weights are differences of coordinates up to 64 pixels, rounded to 4e-6, of which some twenty meet in a pixel.
SHARE_TOLERANCE = 2e-5
# A tap of a block's own memory is rounded to half a step, 2^-21 of the largest flux, which is 2.
STEP_TOLERANCE = SHARE_TOLERANCE + 20 * 2.0**-20

WINDOW = 32
private_patches = make_private_patches(ACROSS, WINDOW)
FORMS = {"plain": plain, "each_channel": each_channel, "merged": merged, "quads": quads, "rgba": rgba,
         "binned": binned, "private_tiles": private_tiles, "private_patches": private_patches}  # fmt: skip
INTEGER = ("plain", "merged", "binned", "private_tiles", "private_patches")
"""Forms that can add in fixed point."""


def landings(seed=0):
    """Give a wavy lattice over the map and past it, corners and borders, places far away, and no places at all."""
    rng = np.random.default_rng(seed)
    columns, rows = RESOLUTION
    j, i = np.meshgrid(np.arange(ACROSS), np.arange(ACROSS))
    x = j * (columns + 6.0) / ACROSS - 3.0 + 4.0 * np.sin(0.2 * i) + rng.normal(0.0, 0.3, j.shape)
    y = i * (rows + 6.0) / ACROSS - 3.0 + 4.0 * np.cos(0.15 * j) + rng.normal(0.0, 0.3, j.shape)
    place = np.stack([x, y], axis=-1).reshape(-1, 2)
    border = [-1.0, -0.5, -0.25, 0.0, 0.5]
    ends = np.array([[x, y] for x in [*border, *(columns + b for b in border)] for y in [*border, rows - 0.5, rows]])
    far = [1e9, -1e9, 3e38, np.inf, -np.inf, np.nan]
    place[rng.permutation(len(place))[: len(ends)]] = ends
    place[rng.permutation(len(place))[: 3 * len(far)]] = [p for f in far for p in ((f, 3.0), (3.0, f), (f, f))]
    return rounded(place)


def expected(place, width, flux):
    """Sum of the boxes' overlaps with the pixels, over their area, in float64."""
    place, flux = place[np.isfinite(place).all(axis=1)], flux[np.isfinite(place).all(axis=1)]
    sides = []
    for axis in (0, 1):
        pixel = np.arange(RESOLUTION[axis])
        low, high = (place[:, axis, None] + s * 0.5 * width for s in (-1.0, 1.0))
        if width > 0.0:
            sides.append(np.maximum(np.minimum(high, pixel + 1.0) - np.maximum(low, pixel), 0.0) / width)
        else:
            sides.append((np.floor(low) == pixel).astype(float))
    return np.einsum("nr,nk,nc->rkc", sides[1], sides[0], flux)


def fluxes(count, channels, seed=1):
    return rounded(np.random.default_rng(seed).uniform(0.5, 2.0, (count, channels)))


def splatted(form, place, flux, device, width, accumulate="float32", threads=1):
    bands = zip(np.array_split(place, threads), np.array_split(flux, threads), strict=True)
    photons = [land(at[:, 0], at[:, 1], of, RESOLUTION, device, width, accumulate) for at, of in bands]
    run, read = make_frame(form, photons)
    run()
    run()  # a frame does not remember the last
    return read()


def takes(name, channels, width):
    return not (
        (name == "each_channel" and channels == 1)
        or (name == "rgba" and channels == 1)
        or (name == "quads" and width == 0.0)
        or (name == "private_tiles" and channels == 3 and width == 0.0)  # a kernel of its own, for no new branch
    )


@pytest.mark.parametrize("width", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("name", FORMS)
def test_every_form_gives_the_overlaps(device, name, channels, width):
    if not takes(name, channels, width):
        pytest.skip("not a case of this form")
    place = landings()
    flux = fluxes(len(place), channels)
    found = splatted(FORMS[name], place, flux, device, width)
    tolerance = STEP_TOLERANCE if name.startswith("private") else SHARE_TOLERANCE
    assert np.abs(found - expected(place, width, flux)).max() < tolerance / max(width, 0.5)


@pytest.mark.parametrize("name", ["plain", "merged"])
def test_a_box_wider_than_a_pixel(device, name):
    place = landings()
    flux = fluxes(len(place), 1)
    found = splatted(FORMS[name], place, flux, device, 2.25)
    assert np.abs(found - expected(place, 2.25, flux)).max() < SHARE_TOLERANCE


@pytest.mark.parametrize("name", ["quads", "rgba", "binned", "private_tiles", "private_patches"])
def test_what_a_form_cannot_add_is_refused(name):
    place = landings()
    with pytest.raises(ValueError, match=r"2\.25 pixels"):
        splatted(FORMS[name], place, fluxes(len(place), 3), "cpu", 2.25)
    if name in ("quads", "rgba"):
        with pytest.raises(ValueError, match="float32"):
            splatted(FORMS[name], place, fluxes(len(place), 3), "cpu", 1.0, "fixed")


@pytest.mark.parametrize("name", [name for name in FORMS if name != "rgba" and name != "each_channel"])
def test_a_million_photons_in_one_pixel(device, name):
    """A quarter each to four pixels, whose sum float32 holds exactly: no form loses one, nor overflows."""
    count = 2**20
    assert count > 2 * BATCH
    place = np.tile([[float(TILE), 7.0]], (count, 1))  # taps on either side of a tile's edge
    found = splatted(FORMS[name], place, np.ones((count, 1)), device, 1.0)
    by_hand = np.zeros(found.shape)
    by_hand[6:8, TILE - 1 : TILE + 1] = count / 4
    assert (found == by_hand).all()


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("name", INTEGER)
def test_fixed_point_does_not_depend_on_the_order(device, name, channels):
    """Bit for bit; and sorting alone changes no bit of the merged form."""
    place = landings()
    flux = fluxes(len(place), channels)
    first = splatted(FORMS[name], place, flux, device, 1.0, "fixed")
    # Each tap is rounded to a step; a block's own are coarser.
    tolerance = STEP_TOLERANCE if name.startswith("private") else SHARE_TOLERANCE + len(place) * unit("fixed")
    assert np.abs(first - expected(place, 1.0, flux)).max() < tolerance
    order = np.random.default_rng(3).permutation(len(place))
    assert (splatted(FORMS[name], place[order], flux[order], device, 1.0, "fixed") == first).all()
    if name == "binned":
        assert (splatted(merged, place, flux, device, 1.0, "fixed") == first).all()


def test_threads_with_maps_of_their_own_add_up_to_the_same_bits():
    place = landings()
    flux = fluxes(len(place), 3)
    one = splatted(merged, place, flux, "cpu", 1.0, "fixed")
    for threads in (2, 8):
        assert (splatted(merged, place, flux, "cpu", 1.0, "fixed", threads) == one).all()


COLOURED = {"ior": 1.333, "fresnel": True, "absorption": [0.4, 0.1, 0.05]}
POND = 1.0 + 0.02 * np.sin(np.arange(8.0)[:, None] + 0.7 * np.arange(9.0))


@pytest.mark.parametrize("water", ["waves", "plain waves", "waves with Fresnel", "bounded"])
def test_any_run_of_columns_gives_the_same_map_and_ledger(device, water, monkeypatch, tmp_path):
    """A thread a photon, a run that divides no row, a whole row, waves by blocks: one sum, a ledger that adds up."""
    if water == "waves":
        what = scene(GENTLE, medium=COLOURED)
    elif water == "plain waves":
        what = scene(GENTLE)
    elif water == "waves with Fresnel":
        what = scene(GENTLE, medium={"ior": 1.333, "fresnel": True})
    else:
        what = scene(height_map=save_heights(tmp_path, "pond", POND, (0.3, 0.2), (1.4, 0.7)), medium=COLOURED)
    found = {}
    monkeypatch.setattr(import_module("warp_caustics.methods.photon"), "by_blocks", lambda water, device: False)
    for run in (1, 7, 10**6):
        monkeypatch.setattr(lattice_recording, "columns_each", lambda device, columns, run=run: min(run, columns))
        found[run] = wc.render(what, method="photon", device=device, threads=1)
        assert found[run].energy.unaccounted < 1e-6
    monkeypatch.undo()
    found["blocks"] = wc.render(what, method="photon", device=device, threads=1)
    assert np.all(found[1].energy.reflected > 0.0) == (water != "plain waves")
    assert np.all(found[1].energy.absorbed > 0.0) == (water in ("waves", "bounded"))
    for run in (7, 10**6, "blocks"):
        # Atomics of a GPU come in any order.
        np.testing.assert_allclose(found[run].caustic_map, found[1].caustic_map, rtol=1e-5, atol=1e-6)
        for entry in ("emitted", "received", "reflected", "absorbed", "outside_map", "dropped"):
            one, other = getattr(found[1].energy, entry), getattr(found[run].energy, entry)
            np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-9)


def test_the_rungs_of_the_ladder_are_one_sum(device):
    """What is timed is what is checked, by two threads as by one."""
    for ladder in rungs(64, device)[4:]:  # four photons a pixel; one is the same kernels
        first = None
        for rung in ladder:
            for threads in (1, 2):
                run, read = rung.make(threads)
                run()
                found = read().astype(np.float64)
                first = found if first is None else first
                assert np.linalg.norm(found - first) < rung.tolerance * np.linalg.norm(first), rung.name
        assert first.max() > 3.0 * first.mean()  # folds: many photons meet in a pixel
