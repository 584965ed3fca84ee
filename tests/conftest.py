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


LONG = (
    "test_recorded.py", "test_kills.py", "test_new_drive.py", "test_stability.py", "test_joint.py",
    "test_full_disk.py", "test_fast.py",
    "test_run_link.py", "test_receiving.py", "test_new_effect.py", "test_new_imager.py",
    "test_laboratory.py", "test_convert_image.py", "test_pixel.py", "test_link_plan.py",
    "test_cli.py",
    "test_asynchronous.py", "test_transmission.py", "test_boxes.py", "test_run.py",
    "test_probes.py", "test_chain.py", "test_link_theory.py", "test_capacity.py", "test_glass.py",
    "test_coding.py", "test_comparison.py", "test_shockwave.py",
)  # fmt: skip
"""Files that take longest, the longest first."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files begin first: one that began last would leave the other cores idle. Order within a
    file stays."""
    place = {name: n for n, name in enumerate(LONG)}
    items.sort(key=lambda item: place.get(item.path.name, len(place)))


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
