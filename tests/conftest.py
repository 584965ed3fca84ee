"""What the whole suite shares: recordings, an OpenCL device, settings of hypothesis."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from cosim.compute.opencl import Device, open_device
from tests.browser.driver import Browser, missing_programs

# The launcher exports the name it was called by; messages in tests hold the plain name. Workers of
# the suite and the commands that tests start inherit the change.
os.environ.pop("VIFORM_CALLED", None)

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


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A window of Chromium, shared by the tests of pages; each opens its own page. A machine
    without it skips these tests, except where VIFORM_ALL_TOOLS is set, as in `.ci/run`."""
    if missing := missing_programs():
        lack = pytest.fail if os.environ.get("VIFORM_ALL_TOOLS") else pytest.skip
        lack(f"needs the system packages {' '.join(missing)}")
    with Browser() as window:
        yield window
