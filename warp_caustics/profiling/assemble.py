"""From a traced frame, its bytes and its operations to the tree of passes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

from ..dispersion import DispersedPlan
from .count import Key, Operations, pass_name
from .trace import Launched, TracedFrame, TracedStage, lane_seconds
from .traffic import Traffic, traffic
from .tree import ARITHMETIC, MEMORY, Limits, ProfileNode, joined

if TYPE_CHECKING:
    from ..plan import Plan

DOES = {"clear": "maps and ledgers without light", "stack": "three channels joined into one map"}
"""What passes do that a plan does not list."""


BESIDE = "of no pass of the plan"
"""What is said of others."""


class Assembly:
    """What the nodes of a profile are made with.

    Parameters
    ----------
    plan : Plan or DispersedPlan
        Of the renderer.
    limits : sequence of Limits
        For one thread, and for all.
    operations : dict
        Of the passes of a frame; empty where they were not counted.
    counted : dict
        In how many launches.
    """

    def __init__(
        self, plan: Plan | DispersedPlan, limits: tuple[Limits, ...], operations: Operations, counted: dict[Key, int]
    ) -> None:
        self._plan, self._limits = plan, limits
        self._operations, self._counted = operations, counted
        self._does = _descriptions(plan)

    def frame(self, traced: TracedFrame) -> ProfileNode:
        """Make the tree of a frame: what the host writes, simulated water, and the stages in order."""
        launches: dict[str, int] = {}
        for stage in traced.stages:
            for command, _ in chain.from_iterable(stage.lanes):
                name = pass_name(command)
                launches[name] = launches.get(name, 0) + 1
        children = [ProfileNode("host", "phases, sun and clock put on the device", 1e3 * traced.host)]
        passes = self._passes(traced.water)
        if passes:
            children.append(joined("water", "simulated water, taken to the time of the frame", passes))
        for number, stage in enumerate(traced.stages, 1):
            lanes = tuple(1e3 * lane_seconds(lane) for lane in stage.lanes)
            passes = self._passes(stage, launches)
            if len(passes) == 1:
                children.append(passes[0])
            else:
                threads = min(len(lanes), self._plan.threads)
                does = f"{len(lanes)} lane(s) on {threads} thread(s)"
                children.append(joined(f"stage {number}", does, passes, lanes))
        return joined("frame", f"{self._plan.method} on {self._plan.device}", tuple(children))

    def _passes(self, stage: TracedStage, launches: Mapping[str, int] | None = None) -> tuple[ProfileNode, ...]:
        """Make the passes of a stage; together they take as long as it.

        Parameters
        ----------
        stage : TracedStage
            Its lanes.
        launches : mapping, optional
            Of each pass in the frame; None for simulated water.
        """
        lanes, water = stage.lanes, launches is None
        groups: dict[str, list[Launched]] = {}
        for command, seconds in chain.from_iterable(lanes):
            groups.setdefault(pass_name(command), []).append((command, seconds))
        all_lanes = sum(map(lane_seconds, lanes))
        wall = stage.seconds / all_lanes if all_lanes > 0.0 else 1.0
        limits = self._limits[-1] if len(lanes) > 1 else self._limits[0]
        nodes = []
        for name, launched in groups.items():
            key = water, name
            commands = [command for command, _ in launched]
            moved = _sweeps(commands) if water else traffic(commands)
            operations = self._operations.get(key)
            if operations is not None:
                # Water may have taken another step in the frame that was counted, and a GPU launches other strips.
                share = self._counted[key] if launches is None else launches[name]
                operations = round(operations * len(commands) / share)
            floor, limit = _floor(moved, operations, limits)
            own = tuple(1e3 * sum(s for c, s in lane if pass_name(c) == name) for lane in lanes)
            nodes.append(
                ProfileNode(
                    name, self._does.get(name, BESIDE), 1e3 * wall * lane_seconds(launched), len(commands), moved.read,
                    moved.written, operations, floor, limit, own if len(groups) == 1 and len(lanes) > 1 else (),
                )
            )  # fmt: skip
        return tuple(nodes)


def _sweeps(commands: list[Any]) -> Traffic:
    """Bytes of launches that go over all cells anew, as often as each of them is launched."""
    distinct = {id(command): command for command in commands}
    once, times = traffic(distinct.values()), len(commands) / len(distinct)
    return Traffic(round(times * once.read), round(times * once.written))


def _floor(moved: Traffic, operations: int | None, limits: Limits) -> tuple[float, str | None]:
    """Milliseconds that bytes or operations take at the least, and which of them."""
    memory = 1e3 * (moved.read + moved.written) / limits.bandwidth
    arithmetic = 1e3 * (operations or 0) / limits.operations
    if memory == arithmetic == 0.0:
        return 0.0, None
    return max(memory, arithmetic), MEMORY if memory >= arithmetic else ARITHMETIC


def _descriptions(plan: Plan | DispersedPlan) -> dict[str, str]:
    """What each pass does, by its name."""
    one = plan.plans[0] if isinstance(plan, DispersedPlan) else plan
    lines = {name: does for name, _, does in one.program.pass_lines(one.facts)}
    return {**DOES, **{water.name: water.does for water in one.water_passes}, **lines}
