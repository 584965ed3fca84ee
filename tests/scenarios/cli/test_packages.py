"""System packages: which a command asks the launcher for, on a machine that lacks them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator

import pytest

import cosim.compute.opencl
import display.render.context
import scenarios.cli.maintenance.test
import scenarios.studies.bench.sensor
from cosim.run.called import as_called
from scenarios.cli.entry import _main
from scenarios.cli.start import has_launcher, install_and_restart, read_launcher
from tests.browser.driver import PROGRAMS

OPENCL = "pocl-opencl-icd ocl-icd-libopencl1"
EGL = "libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri"
VERILATOR = "verilator g++ zlib1g-dev"
SMALL = ["--set", "sensor.chip=spikeone", "--set", "image.at=[20]"]
SHORT = [*SMALL, "--set", "duration=2.5 ms"]


class Restarted(BaseException):
    """The process has become the launcher."""


@pytest.fixture
def restarts(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[dict[str, str]]]:
    """The environments of the launcher that a command has started in its own place."""
    environments = []

    def become(path: str, arguments: list[str], environment: dict[str, str]) -> None:
        assert arguments == [path, *sys.argv[1:]]
        environments.append(environment)
        raise Restarted

    monkeypatch.setattr(os, "execve", become)
    monkeypatch.setenv("VIFORM_LAUNCHER", "/clone/viform")
    monkeypatch.setenv("VIFORM_ASKED", "")
    read_launcher()
    yield environments
    monkeypatch.delenv("VIFORM_LAUNCHER", raising=False)
    read_launcher()


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with none of the system packages but OpenCL's."""
    backend = {**display.render.context._BACKEND, "libegl": "libEGL-of-nobody.so.1"}
    monkeypatch.setattr(display.render.context, "_BACKEND", backend)
    monkeypatch.setattr(scenarios.studies.bench.sensor, "probe_gl", lambda: (False, "no GL"))
    monkeypatch.setattr(shutil, "which", lambda name: None)


@pytest.fixture
def no_opencl(monkeypatch: pytest.MonkeyPatch) -> None:
    import pyopencl

    monkeypatch.setattr(pyopencl, "get_platforms", list)


@pytest.mark.usefixtures("bare", "no_opencl")
@pytest.mark.parametrize(
    ("arguments", "packages"),
    [
        (["run", "step", *SHORT], OPENCL),
        (["plan", "step", *SHORT], OPENCL),
        (["accuracy", "step", *SHORT], OPENCL),
        (["run", "light-link"], OPENCL),
        (["compare", "star"], OPENCL),
        (["stability"], OPENCL),
        (["bench", "sensor"], OPENCL),
        (["plan", "ebaps-night"], None),
        (["list"], None),
        (["bench", "display", "--device", "numba"], EGL),
        (["run", "glass", *SHORT, "--device", "numba"], EGL),
        (["board", "identify"], VERILATOR),
        (["run", "bring-up"], VERILATOR),
        (["board", "gateware", "ulx3s-25f", "--cells", "--out", "d"], "yosys"),
        (["board", "gateware", "ulx3s-25f", "--out", "d"], None),
    ],
    ids=lambda value: " ".join(value[:3]) if isinstance(value, list) else None,
)  # fmt: skip
def test_a_command_asks_for_what_it_lacks(
    tmp_path, monkeypatch, restarts, capsys, arguments, packages
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["viform", *arguments])
    if packages is None:
        assert _main(arguments) == 0
        return
    with pytest.raises(Restarted):
        _main(arguments)
    assert restarts[0]["VIFORM_INSTALL"] == packages
    assert capsys.readouterr().out == ""
    # The second start finds nothing in its way.
    assert [path.name for path in tmp_path.rglob("*") if path.name != "runs"] == []


@pytest.mark.usefixtures("no_opencl")
def test_what_was_asked_for_before_is_not_asked_for_again(monkeypatch, restarts, refused):
    monkeypatch.setenv("VIFORM_LAUNCHER", "/clone/viform")
    monkeypatch.setenv("VIFORM_ASKED", f" {OPENCL}")
    read_launcher()
    assert _main(["plan", "step", *SHORT]) == 2
    assert restarts == []


@pytest.mark.usefixtures("no_opencl")
def test_drivers_in_other_places_are_the_users_own(monkeypatch, restarts):
    monkeypatch.setenv("OCL_ICD_VENDORS", "/opt/vendors")
    assert _main(["plan", "step", *SHORT]) == 2
    assert restarts == []


def test_children_know_of_no_launcher(restarts):
    child = "import os; print([name for name in os.environ if name.startswith('VIFORM_')])"
    done = subprocess.run([sys.executable, "-c", child], capture_output=True, text=True)
    assert "LAUNCHER" not in done.stdout and "ASKED" not in done.stdout
    assert has_launcher()
    with pytest.raises(Restarted):
        install_and_restart(["yosys"])
    assert restarts[0]["VIFORM_ASKED"] == ""


def test_the_tests_ask_for_everything_at_once(monkeypatch, restarts):
    monkeypatch.setattr(cosim.compute.opencl, "probe", list)
    monkeypatch.setattr(display, "probe_gl", lambda: (False, "no GL"))
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(sys, "argv", ["viform", "test", "-k", "house"])
    with pytest.raises(Restarted):
        _main(["test", "-k", "house"])
    assert restarts[0]["VIFORM_INSTALL"].split() == [
        *OPENCL.split(), *EGL.split(), "verilator", "g++", "iverilog", "yosys",
        *PROGRAMS.values(), "zlib1g-dev",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("called", "text", "shown"),
    [
        (None, "see `viform list`", "see `viform list`"),
        ("./viform", "<pre>viform run a\nviform image b</pre>",
         "<pre>./viform run a\n./viform image b</pre>"),
        ("/a clone/viform", "`viform link send F`", "`'/a clone/viform' link send F`"),
        ("./viform", "viform 0.1, viform: /b/viform run", "viform 0.1, viform: /b/viform run"),
    ],
)  # fmt: skip
def test_commands_are_printed_as_the_user_calls_them(monkeypatch, called, text, shown):
    monkeypatch.delenv("VIFORM_CALLED", raising=False)
    if called:
        monkeypatch.setenv("VIFORM_CALLED", called)
    assert as_called(text) == shown
