"""A comparison: its rows, its files, its command, and what it refuses."""

from __future__ import annotations

import json
import math
import re
import shutil
import signal
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenery import GENTLE, save_quad, scene

import warp_caustics as wc
from warp_caustics.cli import main
from warp_caustics.comparison import machine, measure, run, settings
from warp_caustics.comparison.measure import enough
from warp_caustics.comparison.picture import draw
from warp_caustics.comparison.record import load_comparison
from warp_caustics.scene import BeamSettings, GatherSettings, PhotonSettings

PNG = b"\x89PNG\r\n\x1a\n"
FEW = {
    "beam": (
        settings.Series("beam", "beam", (BeamSettings(), BeamSettings(samples_per_pixel=4.0))),
        settings.Series("beam unrefined", "beam", (BeamSettings(refine=False),)),
    ),
    "photon": (settings.Series("photon cell", "photon", (PhotonSettings(),)),),
    "gather": (settings.Series("gather", "gather", (GatherSettings(n=7), GatherSettings())),),
}
ERROR_BAR = 1e-6  # float32 maps of one setting
ROOT = Path(__file__).parents[1]


def stand_in(of: wc.Scene, time: float = 0.0, **options: Any) -> SimpleNamespace:
    """A reference that takes no time, and that one setting meets: the beam at 4 cells a pixel."""
    best = settings.with_settings(of, "beam", BeamSettings(samples_per_pixel=4.0))
    result = wc.render(best, time=time, device=options["device"], threads=options["threads"])
    return SimpleNamespace(
        caustic_map=result.caustic_map.astype(np.float64), energy=result.energy, error_bar=ERROR_BAR, samples=4.0,
        seconds=0.0, cached=False,
    )  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch) -> None:
    """Few settings, few frames, no real reference: what is tested is neither the times nor the errors."""
    monkeypatch.setattr("warp_caustics.reference.make_reference", stand_in)
    monkeypatch.setattr(measure, "ENOUGH_SECONDS", 0.0)
    monkeypatch.setattr(run, "PUBLISHED", run.PUBLISHED[:1] + run.PUBLISHED[-1:])
    for name in list(settings.SERIES):
        monkeypatch.delitem(settings.SERIES, name)
    settings.SERIES.update(FEW)


@pytest.fixture
def pool() -> wc.Scene:
    return scene(GENTLE, resolution=(16, 12))


@pytest.fixture
def ramp(tmp_path) -> wc.Scene:
    """A receiver that the gather cannot serve."""
    return scene(GENTLE, receiver={"mesh": save_quad(tmp_path, slope=(0.05, 0.02))}, resolution=(16, 12))


@pytest.fixture
def scene_file(pool, tmp_path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(pool.to_toml())
    return path


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.rglob("*") if path.is_file()}


# --- in Python -------------------------------------------------------------------------------------------------------


def test_every_setting_is_measured_beside_the_reference(pool, device):
    comparison = wc.compare(pool, ("beam", "photon", "gather"), device=device, threads=1)
    assert [row.label for row in comparison.rows[:4]] == ["beam 1", "beam 4", "beam unrefined 1", "photon cell 4"]
    assert comparison.rows[4].label == "gather N=7"
    assert comparison.rows[5].label.startswith("gather N=")
    assert comparison.rows[5].label.endswith(" auto")
    assert comparison.rows[5].settings["n"] % 2 == 1
    truth = stand_in(pool, device=device, threads=1).caustic_map
    for row in comparison.rows:
        assert row.status == "measured"
        assert row.speed.frames >= 3
        assert row.speed.milliseconds_low <= row.speed.milliseconds <= row.speed.milliseconds_high
        assert row.speed.samples_per_second == pytest.approx(1e3 * row.speed.samples / row.speed.milliseconds)
    first = wc.render(pool, method="beam", device=device, threads=1)
    expected = np.sqrt(np.mean((first.caustic_map - truth) ** 2)) / truth.mean()
    assert comparison.rows[0].errors.relative_l2 == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert comparison.rows[0].speed.bytes == first.plan.bytes
    assert [row.at_error_bar for row in comparison.rows[:3]] == [False, True, False]
    assert comparison.machine.device == device
    assert comparison.front
    assert all(row.on_front for row in comparison.front)
    times = [row.speed.milliseconds for row in comparison.front]
    assert times == sorted(times)


def test_published_figures_are_marked(pool):
    comparison = wc.compare(pool, methods=["gather"], threads=1)
    ours, theirs = comparison.published
    assert not ours.measured_here
    assert not theirs.measured_here
    assert ours.hardware == "GeForce 9600 GT"
    assert ours.milliseconds_low == 1.04
    assert ours.ours_milliseconds > 0.0
    assert theirs.ours_milliseconds is None
    assert all(one.ours_milliseconds is None for one in wc.compare(pool, methods=["photon"], threads=1).published)


def test_a_method_that_cannot_is_a_row_with_the_reason(ramp):
    comparison = wc.compare(ramp, methods=["photon", "gather"], threads=1)
    refused = [row for row in comparison.rows if row.status == "refused"]
    assert [row.method for row in refused] == ["gather", "gather"]
    assert all("a plane or a terrain" in row.reason and row.errors is None and row.speed is None for row in refused)
    assert not any(row.on_front for row in refused)
    assert comparison.published[0].ours_milliseconds is None


def test_methods_that_cannot_and_no_other_are_bad_input(ramp):
    with pytest.raises(wc.InputError, match="a plane or a terrain"):
        wc.compare(ramp, methods=["gather"])


@pytest.mark.parametrize("methods", [["beem"], ["beam", "reference"], []])
def test_unknown_methods_are_refused_with_those_known(pool, methods):
    with pytest.raises(wc.InputError, match="beam, photon, gather"):
        wc.compare(pool, methods=methods)


def test_a_broken_map_is_infinitely_wrong_and_on_no_front(pool, monkeypatch, tmp_path):
    measured = measure.measure

    def broken(*arguments):
        one = measured(*arguments)
        one.result.caustic_map[0, 0] = math.nan
        return one

    monkeypatch.setattr(measure, "measure", broken)
    comparison = wc.compare(pool, methods=["photon"], threads=1)
    (row,) = comparison.rows
    assert row.status == "broken"
    assert "not finite" in row.reason
    assert row.errors.relative_l2 == math.inf
    assert not row.on_front
    assert comparison.slopes[0].slope is None
    comparison.save(tmp_path)  # a picture without a point, and infinities in the JSON
    assert load_comparison(tmp_path / "compare.json") == comparison
    assert json.loads((tmp_path / "compare.json").read_text())["rows"][0]["errors"]["relative_l2"] == "Infinity"


def test_the_settings_of_the_scene_are_tried_too(pool):
    own = wc.Scene(**{**dict(pool), "method": {"beam": {"samples_per_pixel": 2.0}}})
    labels = [row.label for row in wc.compare(own, methods=["beam"], threads=1).rows]
    assert labels[-1] == "beam as in the scene 2"


def test_each_step_is_told(pool):
    told = []
    wc.compare(pool, methods=["beam"], threads=1, tell=lambda *step: told.append(step))
    assert [number for number, _, _ in told] == list(range(len(told)))
    assert {count for _, count, _ in told} == {len(told)}
    assert told[0][2] == "reference"


def test_the_slope_of_jittered_photons_joins(pool, monkeypatch):
    from warp_caustics.comparison import jittered

    truth = stand_in(pool, device="cpu", threads=1).caustic_map

    def photons(of, time, *, per_side, seed, device, threads):
        # an error of count ** -0.75 of the mean, in a pattern whose mean square is 1
        pattern = np.where(np.indices(truth.shape).sum(axis=0) % 2, 1.0, -1.0)
        return truth + truth.mean() * per_side**-1.5 * pattern

    monkeypatch.setattr(jittered, "jittered_photons", photons)
    comparison = wc.compare(pool, methods=["photon"], device="cpu", threads=1)
    assert comparison.slopes[-1].series == jittered.SERIES
    assert comparison.slopes[-1].slope == pytest.approx(-0.75, rel=1e-6)


def test_frames_that_are_enough():
    assert not enough([])
    assert not enough([5.0])
    assert enough([2.0, 2.0])  # slow: two do
    assert not enough([1.0, 1.0])
    assert enough([0.001] * 3)  # with ENOUGH_SECONDS at 0, as here


# --- its files -------------------------------------------------------------------------------------------------------


def test_the_record_comes_back_as_it_was(pool, tmp_path):
    comparison = wc.compare(pool, methods=["beam"], threads=1)
    paths = comparison.save(tmp_path / "new" / "folder")
    assert [path.name for path in paths] == ["compare.json", "compare.png"]
    assert load_comparison(paths[0]) == comparison
    record = json.loads(paths[0].read_text())
    assert record["schema_version"] == 1
    assert record["scene"] == pool.to_toml()
    assert {"warp", "numpy", "python", "warp_caustics"} <= set(record["versions"])
    assert record["machine"]["cores"] >= 1
    assert paths[1].read_bytes().startswith(PNG)


def test_a_record_of_another_version_is_refused(pool, tmp_path):
    path = tmp_path / "other.json"
    text = wc.compare(pool, methods=["photon"], threads=1).to_json()
    path.write_text(text.replace('"schema_version": 1', '"schema_version": 2'))
    with pytest.raises(wc.InputError, match="schema_version"):
        load_comparison(path)
    with pytest.raises(wc.InputError, match="cannot be read"):
        load_comparison(tmp_path / "none.json")


def test_the_schema_in_the_docs_is_the_models():
    stored = json.loads((ROOT / "docs" / "compare.schema.json").read_text(encoding="utf-8"))
    made = wc.Comparison.model_json_schema(mode="serialization")

    def described(schema: dict) -> dict:
        tables = {"Comparison": schema, **schema["$defs"]}
        return {
            name: {key: field.get("description") for key, field in table["properties"].items()}
            for name, table in tables.items()
        }

    assert described(stored) == described(made), "run python docs/make_compare_schema.py"


@pytest.mark.skipif(shutil.which("git") is None, reason="there is no git here")
def test_the_commit_is_that_of_this_project_or_none(tmp_path):
    def git(*words: str) -> None:
        author = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
        subprocess.run(["git", "-C", str(tmp_path), *author, *words], check=True, capture_output=True)

    settings_file = tmp_path / "pyproject.toml"
    settings_file.write_text('[project]\nname = "warp-caustics"\n')
    assert machine.commit(tmp_path) is None  # no checkout
    git("init")
    assert machine.commit(tmp_path) is None  # no commit yet
    git("add", ".")
    git("commit", "-m", "first")
    found = machine.commit(tmp_path)
    assert found is not None
    assert re.fullmatch("[0-9a-f]{40}", found)
    settings_file.write_text('[project]\nname = "warp-caustics"\nversion = "1"\n')
    assert machine.commit(tmp_path) == f"{found}-dirty"
    settings_file.write_text('[project]\nname = "something-else"\n')
    assert machine.commit(tmp_path) is None


def test_a_device_is_a_folder_name():
    name = machine.slug("cpu")
    assert name == name.lower()
    assert name.replace("-", "").isalnum()
    assert name.endswith(f"{machine.cores()}-cores")


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_prints_and_writes(scene_file, tmp_path, capfd):
    out = tmp_path / "out"
    assert main(["compare", str(scene_file), "--threads", "1", "-o", str(out)]) == 0
    printed, err = capfd.readouterr()
    assert err == ""
    assert files(out) == {"compare.json", "compare.png"}
    for word in ("beam 4", "photon cell 4", "gather N=7", "error bar", "on the front", "slope", "not measured here"):
        assert word in printed
    assert "GeForce 9600 GT" in printed
    assert str(out / "compare.png") in printed


def test_the_command_takes_some_methods_and_writes_nothing_unasked(scene_file, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["compare", str(scene_file), "--methods", "beam, photon"]) == 0
    printed = capfd.readouterr().out
    assert "photon cell 4" in printed
    assert "gather N=7" not in printed
    assert files(tmp_path) == {"small.toml"}


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        (["--methods", "beam,beem"], "beem"),
        (["--methods", ""], "beam, photon, gather"),
        (["-o", "a_file"], "not a folder"),
        (["-o", "a_file/deeper"], "not a folder"),
        (["-o", "taken"], "is a folder"),
        (["--device", "cuda:99"], "cpu"),
        (["--threads", "0"], "--threads"),
    ],
)
def test_a_bad_command_is_refused_before_the_work(scene_file, tmp_path, capfd, monkeypatch, tokens, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a_file").touch()
    (tmp_path / "taken" / "compare.json").mkdir(parents=True)

    def work(*_, **__):
        raise AssertionError("this is too late")

    monkeypatch.setattr("warp_caustics.reference.make_reference", work)
    assert main(["compare", str(scene_file), *tokens]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert words in err
    assert files(tmp_path) == {"small.toml", "a_file"}


def test_an_interrupt_leaves_nothing(scene_file, tmp_path, capfd, monkeypatch):
    measured = measure.measure

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return measured(*arguments)

    monkeypatch.setattr(measure, "measure", interrupted)
    assert main(["compare", str(scene_file), "-o", str(tmp_path / "out")]) == 130
    out, err = capfd.readouterr()
    assert (out, err) == ("", "error: interrupted\n")
    assert files(tmp_path) == {"small.toml"}


def test_an_interrupt_while_files_are_written_waits_for_their_end(scene_file, tmp_path, monkeypatch):
    from warp_caustics.comparison import picture

    as_drawn = picture.draw

    def interrupted(comparison):
        signal.raise_signal(signal.SIGINT)
        return as_drawn(comparison)

    monkeypatch.setattr(picture, "draw", interrupted)
    assert main(["compare", str(scene_file), "--methods", "photon", "-o", str(tmp_path / "out")]) == 130
    assert files(tmp_path / "out") == {"compare.json", "compare.png"}


def test_a_name_with_signs_of_mathematics_is_drawn_as_it_is(pool, tmp_path):
    odd = pool.model_copy(update={"name": "a$^$b"})
    assert all(path.is_file() for path in wc.compare(odd, methods="beam", device="cpu", threads=1).save(tmp_path))


def test_errors_of_nothing_stay_in_the_picture(pool):
    comparison = wc.compare(pool, methods=["beam"], device="cpu", threads=1)
    rows = [row.model_copy(update={"errors": row.errors.model_copy(update={"relative_l2": 0.0})})
            for row in comparison.rows]  # fmt: skip
    exact = comparison.reference.model_copy(update={"error_bar": 0.0})
    axes = draw(comparison.model_copy(update={"rows": rows, "reference": exact})).axes[0]
    low, high = axes.get_ylim()
    for line in axes.lines:
        assert ((low < line.get_ydata()) & (line.get_ydata() < high)).all()
