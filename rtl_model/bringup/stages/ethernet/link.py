"""Stage link: checks that Etherbone probes and reads of the bus are answered."""

from __future__ import annotations

import numpy as np

from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host import Cause, LineFault

_PROBES = 4
_READS = 64  # one after another, of one word


def check_link(bench: UdpBench) -> Figures:
    """Sends probes, which the network core answers, and reads, which the design's bus answers.

    Raises LineFault silent, or garbled if what arrives is no Etherbone; StageFault bus if probes
    are answered and reads are not, garbled if one register gives several values.
    """
    probes = [bench.bone.probe() for _ in range(_PROBES)]
    address = bench.address("ctrl_magic") if bench.csr.is_viform_board else 0
    times, words = [], []
    try:
        for _ in range(_READS):
            begun = bench.port.now()
            words.append(bench.bone.read(address)[0])
            times.append(bench.port.now() - begun)
    except LineFault as fault:
        if fault.cause is not Cause.SILENT:
            raise
        raise StageFault(
            "bus", f"probes are answered by {bench.port.name}, but reads are not",
            "the network works: check the design behind Etherbone, its clock and its reset",
        ) from fault  # fmt: skip
    if len(set(words)) > 1:
        values = ", ".join(f"{word:#010x}" for word in dict.fromkeys(words))
        raise StageFault(
            "garbled", f"one register read {_READS} times gives {values}",
            "check the design's bus, and that no other board has this IP address",
        )  # fmt: skip
    bench.magic = words[0]
    typical = float(np.median(times))
    return {
        "answers": len(words), "probe_ms": 1e3 * min(probes), "round_trip_ms": 1e3 * typical,
        "round_trips_per_s": 1 / max(typical, 1e-9),
    }  # fmt: skip
