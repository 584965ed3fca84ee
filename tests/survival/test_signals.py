"""Every kind of run ends after SIGTERM, wherever it is: no wait and no long call is deaf.

The time is that of the processor: a busy machine makes no difference.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cosim.compute.cores import cores
from cosim.compute.stopping import GRACE_S

SMALL = ("sensor.width=64", "sensor.height=64", "duration=5 ms")
PANEL = ("link.panel.width=192", "link.panel.height=192", "sensor.chip=spikeone")
RUNS = {
    "film": ("film", *SMALL),
    "asynchronous": ("film", *SMALL, "sensor.pixel=asynchronous"),
    "continuous": ("film", *SMALL, "sensor.pixel=continuous"),
    "display of a noisy chip": ("glass", *SMALL, "sensor.preset=silicon"),
    "link": ("light-link", *PANEL, "link.size=2000"),
    "link with forward-backward": (
        "light-link", *PANEL, "link.size=2000", "link.modem.detector=forward-backward",
    ),
    "carried stream": ("glass-over-light", *SMALL),
    "imager": ("ebaps-night",),
    "bring-up": ("bring-up",),
}  # fmt: skip


def spent(pid: int) -> float:
    """Processor time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_a_run_ends_after_sigterm(name: str, tmp_path: Path) -> None:
    scenario, *sets = RUNS[name]
    chance = random.Random(name)
    for number in range(3):
        words = ["run", scenario, "--out", str(tmp_path / str(number))]
        words += [word for key in sets for word in ("--set", key)]
        command = [sys.executable, "-c", "from scenarios.cli import main; main()", *words]
        with (tmp_path / "said").open("w+", encoding="utf-8") as said:
            child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
            moment = chance.uniform(2, 30)  # of its processor time
            while child.poll() is None and spent(child.pid) < moment:
                time.sleep(0.1)
            if child.poll() is not None:
                assert child.returncode in (0, 1)
                continue
            before = spent(child.pid)
            child.send_signal(signal.SIGTERM)
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            said.seek(0)
            assert child.returncode == 130
            assert "interrupted" in said.read()
            after = usage.ru_utime + usage.ru_stime - before
            assert after <= (GRACE_S + 0.5) * cores()
