"""Requirements of the comparison with LiteX: a Python with LiteX, and Verilator."""

import os
import shutil
import subprocess

import pytest


@pytest.fixture(scope="session")
def litex_python():
    """The Python named by VIFORM_LITEX_PYTHON, in which LiteX can be imported."""
    python = os.environ.get("VIFORM_LITEX_PYTHON")
    if not python:
        pytest.skip("VIFORM_LITEX_PYTHON names no Python with LiteX (2024.12), migen and pyserial")
    probe = subprocess.run([python, "-c", "import litex, migen, serial"], capture_output=True)
    if probe.returncode:
        pytest.skip(f"{python} (VIFORM_LITEX_PYTHON) cannot import litex, migen and serial")
    return python


@pytest.fixture(scope="session")
def verilator():
    """Verilator's name."""
    found = shutil.which("verilator")
    if found is None:
        pytest.skip("needs Verilator (packages: verilator g++ make)")
    return found
