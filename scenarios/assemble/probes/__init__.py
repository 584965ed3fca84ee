"""Probes: small test light filmed by a scenario's chip and shown, for what a display's table says
of latency, blur and flicker."""

from scenarios.assemble.probes.blur import Blur
from scenarios.assemble.probes.flicker import Flicker
from scenarios.assemble.probes.latency import Delay, Latency
from scenarios.assemble.probes.metrics import EDGES, RATES, Probes, display_metrics, probe_display

__all__ = [
    "EDGES", "RATES", "Blur", "Delay", "Flicker", "Latency", "Probes", "display_metrics",
    "probe_display",
]  # fmt: skip
