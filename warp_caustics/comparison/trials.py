"""The settings to measure on a scene, planned before any work, so that what is wrong is said at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from warp_caustics.comparison.settings import Series, Settings, label, series_of, with_settings
from warp_caustics.dispersion import DispersedPlan
from warp_caustics.errors import InputError
from warp_caustics.plan import Plan, make_plan
from warp_caustics.scene import Scene


@dataclass(frozen=True)
class Trial:
    """A setting to measure.

    Attributes
    ----------
    series, settings
        Which.
    label : str
        The setting in a few letters.
    scene : Scene
        With this method and these settings.
    refusal : str or None
        Why it cannot be measured.
    looks : bool
        Whether it is judged in eye pixels alone.
    """

    series: Series
    settings: Settings
    label: str
    scene: Scene
    refusal: str | None
    looks: bool = False


def plan_trials(scene: Scene, names: Sequence[str], device: str, threads: int | None) -> list[Trial]:
    """Plan every setting of these methods.

    Raises
    ------
    InputError
        If none can be planned: then it is not the setting that is wrong.
    """
    trials = [
        _planned(series, settings, with_settings(scene, name, settings), device, threads)
        for name in names
        for series in series_of(scene, name)
        for settings in series.settings
    ]
    if all(trial.refusal is not None for trial in trials):
        raise InputError(trials[0].refusal)
    return trials


def _planned(series: Series, settings: Settings, scene: Scene, device: str, threads: int | None) -> Trial:
    try:
        plan = make_plan(scene, device=device, threads=threads)
    except InputError as error:
        return Trial(series, settings, label(series, settings, {}), scene, str(error))
    assert isinstance(plan, Plan | DispersedPlan)
    looks = isinstance(plan, Plan) and plan.program.looks
    return Trial(series, settings, label(series, settings, plan.settings), scene, None, looks)
