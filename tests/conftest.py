"""What the whole suite shares: recordings, an OpenCL device, settings of hypothesis."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from cosim.compute.opencl import Device, open_device

# Nothing here may fail because a machine is slow or busy.
settings.register_profile(
    "viform", deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("viform")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of recordings and clips that are too large for the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("needs shared/data beside the repository, which is not there")
    return folder


@pytest.fixture(scope="session")
def device() -> Device:
    """The first OpenCL device. A machine without one fails these tests: half of what they hold true
    could not be looked at."""
    return open_device()
