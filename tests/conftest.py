"""What every test may ask for."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import warp as wp
from hypothesis import settings

from warp_caustics.reference.cache import FOLDER_VARIABLE

# Set before Warp initialises: its banner and its compile notes would drown the report of a failing test.
wp.config.log_level = wp.LOG_WARNING

# No test asserts a time, and by default each of hypothesis's examples would: a busy machine is no fault of the code.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


def _devices() -> list[str]:
    """Devices to test on: the CPU always, the first CUDA device where there is one."""
    return ["cpu", "cuda:0"] if wp.is_cuda_available() else ["cpu"]


@pytest.fixture(params=_devices())
def device(request: pytest.FixtureRequest) -> str:
    """Name of a device; a test that takes it runs once on each device present."""
    return str(request.param)


@pytest.fixture(scope="session", autouse=True)
def reference_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """References are kept in a folder of this run, not in the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(tmp_path_factory.mktemp("references")))
        yield
