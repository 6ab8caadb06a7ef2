"""What the record of a benchmark leaves out."""

from __future__ import annotations

from typing import Any


def pytest_benchmark_update_machine_info(config: Any, machine_info: dict[str, Any]) -> None:
    """Drop the name of the machine in its network, which says nothing of its speed."""
    machine_info.pop("node", None)
