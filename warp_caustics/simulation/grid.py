"""Grid water on a device: its state at whole steps, and the launches of a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from ..bands import bind_lanes
from ..kernels.height_field import (
    HeightField,
    begin_solve,
    end_solve,
    make_drop,
    make_leap,
    make_pressure,
    make_solve,
    make_surface,
)
from ..recording import Stages, launches, run_stages
from ..water import GRAVITY
from .basin import implicit_iterations
from .chebyshev import chebyshev_coefficients
from .drops import drop_profiles

if TYPE_CHECKING:
    from ..crew import Crew
    from .basin import Basin


class GridWater:
    """Cells of water, stepped from time 0; an earlier time starts again, so that a time has one surface.

    The state is float64: in float32 the level of water with a drop of 5 mm drifts by 0.02 mm in 1e5 explicit steps
    (its energy does not), and the residual of a stiff implicit step does not fall below the solver's tolerance.

    Attributes
    ----------
    surface : wp.array
        Displacement at the cells [m], float64 ``[rows, columns]``, written by :meth:`advance`.
    height, velocity : wp.array
        The state [m, m/s]; the explicit integrator's heights are half a step ahead.
    stages : Stages
        What makes the surface once :meth:`prepare` has been called.
    """

    def __init__(self, basin: Basin, device: str, crew: Crew) -> None:
        self._basin, self._device, self._crew = basin, device, crew
        shape = (basin.rows, basin.columns)
        self.height, self.velocity, self._pressure, self.surface = (
            wp.zeros(shape, dtype=wp.float64, device=device) for _ in range(4)
        )
        self._field = _height_field(basin, device)
        rows, columns = drop_profiles(basin)
        self._row_profiles: wp.array = wp.array(rows, dtype=wp.float64, device=device)
        self._column_profiles: wp.array = wp.array(columns, dtype=wp.float64, device=device)
        self._falling: dict[int, list[int]] = {}
        for number, drop in enumerate(basin.settings.drops):
            self._falling.setdefault(basin.steps_to(drop.time), []).append(number)
        self._steps: int | None = None
        # All that a launch reads before it is written; 0 times a NaN that stayed would be one.
        self._kept: list[wp.array] = [self.height, self.velocity]
        self._step: Callable[[], object]
        self._record()

    def advance(self, time: float) -> None:
        """Make the surface of the whole step nearest to a time [s].

        Raises
        ------
        InputError
            As :meth:`Basin.steps_to`.
        """
        self.prepare(time)
        run_stages(self.stages)

    def prepare(self, time: float) -> None:
        """Step to a time [s]; raises as :meth:`advance`."""
        steps = self._basin.steps_to(time)
        # Between the launches of a step the state is of no time: after an interruption it starts again.
        done, self._steps = self._steps, None
        if done is None or done > steps:
            for array in self._kept:
                array.zero_()
            done = 0
            self._drop(done)
        while done < steps:
            self._step()
            done += 1
            self._drop(done)
        self._steps = done

    def _drop(self, steps: int) -> None:
        for number in self._falling.get(steps, ()):
            self._crew.run(launches(self._drops[number]))

    def _record(self) -> None:
        """Build each kernel and bind its launches."""
        basin, step = self._basin, self._basin.step
        kind = (basin.periodic, basin.solid is not None)
        drag = 0.5 * basin.settings.damping * step
        pressure = make_pressure(*kind, basin.tension > 0.0)
        if basin.explicit:
            self._push = self._bind(pressure, height=self.height, pressure=self._pressure)
            self._leap = self._bind(make_leap(*kind), pressure=self._pressure, step=step, drag=drag,
                                    velocity=self.velocity, height=self.height)  # fmt: skip
            self._step = self._leap_step
        else:
            self._record_solve(make_solve(*kind), pressure, drag)
            self._step = self._solve_step
        self._drops = {
            number: self._bind(make_drop(kind[1]), row_profiles=self._row_profiles, number=number,
                               column_profiles=self._column_profiles, height=self.height)
            for numbers in self._falling.values() for number in numbers
        }  # fmt: skip
        lag = 0.5 * step if basin.explicit else 0.0
        self.stages: Stages = [
            self._bind(make_surface(*kind), height=self.height, velocity=self.velocity, lag=lag, surface=self.surface)
        ]

    def _record_solve(self, solve: wp.Kernel, pressure: wp.Kernel, drag: float) -> None:
        """Bind the launches of an implicit step; those of its iterations, which may be thousands, once for all."""
        basin, step = self._basin, self._basin.step
        stiffness = 0.25 * step**2 / (1.0 + drag)
        ahead = 0.5 * step / (1.0 + drag)
        self._coefficients = chebyshev_coefficients(stiffness * basin.stiffest, implicit_iterations(basin))
        self._mean, self._change = mean, change = [wp.zeros_like(self.height) for _ in range(2)]
        self._kept.append(change)
        self._begin = self._bind(begin_solve, height=self.height, velocity=self.velocity, ahead=ahead, mean=mean)
        self._push = self._bind(pressure, height=mean, pressure=self._pressure)
        self._solve = self._bind(
            solve, height=self.height, velocity=self.velocity, pressure=self._pressure, ahead=ahead,
            stiffness=stiffness, kept=0.0, gained=0.0, change=change, mean=mean,
        )  # fmt: skip
        labels = [argument.label for argument in solve.adj.args]
        self._coefficient_indices = labels.index("kept"), labels.index("gained")
        self._end = self._bind(
            end_solve, mean=mean, per_half_step=2.0 / step, velocity=self.velocity, height=self.height
        )

    def _leap_step(self) -> None:
        self._crew.run(launches(self._push))
        self._crew.run(launches(self._leap))

    def _solve_step(self) -> None:
        kept_index, gained_index = self._coefficient_indices
        push, solve = launches(self._push), launches(self._solve)
        self._crew.run(launches(self._begin))
        for kept, gained in self._coefficients:
            self._crew.run(push)
            for lane in self._solve:
                for launch in lane:
                    # By index and without conversion: by name, a launch would cost half as much again.
                    launch.set_param_at_index_from_ctype(kept_index, kept)
                    launch.set_param_at_index_from_ctype(gained_index, gained)
            self._crew.run(solve)
        self._crew.run(launches(self._end))

    def _bind(self, kernel: wp.Kernel, **values: Any) -> Any:
        """Record a launch over all cells; a parameter that the kernel writes has the name of what it writes."""
        values["field"] = self._field
        return bind_lanes(kernel, self.height.shape, values, self._device, self._crew.threads)


def _height_field(basin: Basin, device: str) -> HeightField:
    """The kernels' form of the cells."""
    field = HeightField()
    if basin.solid is not None:
        field.solid = wp.array(basin.solid, dtype=wp.uint8, device=device)
    field.per_area = wp.vec2d(*(np.asarray(basin.cell) ** -2.0))
    field.gravity, field.tension = GRAVITY * basin.depth, basin.tension * basin.depth
    return field
