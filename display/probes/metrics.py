"""All probes of a display, and their metrics in `result.json`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from cosim.compute.table_cache import cached_value
from cosim.run.result import Metric
from display.panels.panel import FramePanel, Projector, SpikePanel, metric_key
from display.probes.blur import Blur, frame_blur, spike_blur
from display.probes.flicker import Flicker, frame_flicker, spike_flicker, spike_pst_lm
from display.probes.latency import Latency, frame_latency, spike_latency
from display.probes.setup import ProbeCamera
from display.quality.edges import mprt

SPARSE: Final = 0.0015
DIM: Final = 0.018
GREY: Final = 0.18
WHITE: Final = 0.6
BRIGHT: Final = 1.5
RATES: Final = (SPARSE, DIM, GREY, WHITE, BRIGHT)
"""Light of the probes, spikes a cycle: 0.15 % density, dim, mid grey, white, and 1.5 times the
saturation of a pixel."""
EDGES: Final = ((0.0, SPARSE), (0.0, DIM), (0.0, GREY), (GREY, 0.0), (GREY, WHITE), (0.0, BRIGHT))
"""Light (ahead, behind) of the moving edges, spikes a cycle."""
GREYS: Final = ((0.0, GREY), (GREY, 0.0), (GREY, WHITE))
"""The edges for MPRT."""
PST_CLOCK: Final = 100e3
"""Fastest clock for which PstLM is measured, Hz: it needs more than a minute of light."""
NAMES: Final = {
    SPARSE: "sparse", DIM: "dim", GREY: "grey", WHITE: "white", BRIGHT: "bright",
}  # fmt: skip
_Row = TypeVar("_Row")
_NO_DELAY: Final = (
    "the light does not cross half of the step within the recording of the probe, or the pixels "
    "have too many spikes for one"
)
_NO_BLUR: Final = (
    "the light does not settle within the recording of the probe, such as held light that never "
    "becomes dark, or the pixels have too many spikes for a probe"
)
_NO_FLICKER: Final = "the patch is dark, or a second at this clock has too many cycles or spikes"
"""Why a figure is unknown."""


@dataclass(frozen=True)
class Probes:
    """The results of all probes.

    Attributes:
        drive: drive of the panel in the run.
        latency, blur, flicker: rows for all displays.
        pst_lm: PstLM of a patch of mid grey with the drive of the run; None if not measured.
    """

    drive: str
    latency: tuple[Latency, ...]
    blur: tuple[Blur, ...]
    flicker: tuple[Flicker, ...]
    pst_lm: float | None


def probe_display(
    camera: ProbeCamera,
    panel: SpikePanel,
    references: Sequence[FramePanel | Projector],
    seed: int,
    *,
    rates: Sequence[float] = RATES,
    edges: Sequence[tuple[float, float]] = EDGES,
    per_degree: float = 60.0,
    pst_lm: bool = False,
    told: Callable[[int, int], None] = lambda done, total: None,
) -> Probes:
    """Records steps, edges and steady light, and shows them with every drive of the panel.
    Reference panels show the true light.

    A second of light at 40 kHz takes half a second for each light, and 5 s if its rows are sampled
    at noisy instants; `light.MOST` and PST_CLOCK bound the rest.

    Args:
        camera: camera for the test light.
        panel: the panel.
        references: frame displays and projectors.
        seed: seed of the noise.
        rates, edges: selection from `RATES` and `EDGES`.
        per_degree: pixels per degree of visual angle.
        pst_lm: whether PstLM is measured, which takes as long as all other probes; it is not
            measured for clocks above PST_CLOCK.
        told: called with the number of probes that are done, and of all.
    """
    white, luminance = panel.white_rate, panel.luminance
    with threads(cores()) as pool:  # most of the work is compiled
        submit, pst = pool.submit, None
        if pst_lm and panel.clock.hz <= PST_CLOCK:
            pst = submit(spike_pst_lm, camera, panel, GREY, panel.drive, seed)
        flicker = [submit(spike_flicker, camera, panel, [r], per_degree, seed) for r in rates]
        blur = [submit(spike_blur, camera, panel, edge, seed) for edge in edges]
        latency = [submit(spike_latency, camera, panel, [r], seed) for r in rates]
        for other in references:
            latency.append(submit(frame_latency, other, white, rates))
            blur.append(submit(frame_blur, other, white, edges))
            flicker.append(submit(frame_flicker, other, white, luminance, rates, per_degree))
        every: list[Future[Any]] = [*flicker, *blur, *latency, *([] if pst is None else [pst])]
        told(0, len(every))
        for done, _ in enumerate(as_completed(every)):
            told(done + 1, len(every))
        return Probes(
            panel.drive, _rows(latency), _rows(blur), _rows(flicker), pst.result() if pst else None
        )


def kept_probes(
    camera: ProbeCamera, panel: SpikePanel, references: Sequence[FramePanel | Projector], seed: int,
    *, per_degree: float, pst_lm: bool, told: Callable[[int, int], None],
) -> Probes:  # fmt: skip
    """`probe_display`, from an earlier run of the same camera and display if there is one: the
    results depend on these alone, and not on the scene. Those of a camera that cannot be described
    are computed."""

    def make() -> Probes:
        return probe_display(
            camera, panel, references, seed, per_degree=per_degree, pst_lm=pst_lm, told=told
        )

    arguments = camera.identity, panel, references, seed, per_degree, pst_lm
    return cached_value("probes", arguments, ("cosim", "display", "sensor"), Probes, make)


def _rows(parts: Sequence[Future[list[_Row]]]) -> tuple[_Row, ...]:
    return tuple(row for part in parts for row in part.result())


def _known(value: float, unit: str, reason: str) -> Metric:
    return Metric(value if math.isfinite(value) else None, unit, reason)


def display_metrics(probes: Probes) -> dict[str, Metric]:
    """The metrics by name; None for a figure that does not exist, such as for held light that never
    becomes dark.

    `latency_LIGHT_us` is the median for the impulse drive, from dark to light; `_hold` and
    `_causal` mark the other drives, `_fall` the step from light to dark. LIGHT is sparse (0.15 %
    density), dim, grey, white, or bright. `ebet_ms_spike`, `flicker_*_spike` and `pst_lm_spike` are
    for the drive of the run at mid grey, `ebet_ms_DISPLAY` for an edge from dark to mid grey.
    `mprt_ms_*` is the mean of BET (10 to 90 %) over `GREYS`.
    """
    figures: dict[str, Metric] = {}
    for delay in probes.latency:
        name = f"latency_{NAMES[delay.rate]}{'_fall' if delay.way == 'fall' else ''}_us"
        if delay.display != "spike":
            if delay.rate == GREY:
                figures[f"{name}_{metric_key(delay.display)}"] = _known(
                    delay.total.median, "us", _NO_DELAY
                )
            continue
        name += "" if delay.drive == "impulse" else f"_{delay.drive}"
        figures[name] = _known(delay.total.median, "us", _NO_DELAY)
    for edge in probes.blur:
        if (edge.ahead, edge.behind) == (0.0, GREY):
            if edge.display != "spike":
                figures[f"ebet_ms_{metric_key(edge.display)}"] = _known(
                    edge.ebet * 1e3, "ms", _NO_BLUR
                )
                continue
            figures[f"ebet_ms_{edge.drive}"] = _known(edge.ebet * 1e3, "ms", _NO_BLUR)
            if edge.drive == probes.drive:
                figures["ebet_ms_spike"] = _known(edge.ebet * 1e3, "ms", _NO_BLUR)
        elif (edge.ahead, edge.behind) == (0.0, SPARSE) and edge.display == "spike":
            figures[f"ebet_ms_{edge.drive}_sparse"] = _known(edge.ebet * 1e3, "ms", _NO_BLUR)
    for kind in dict.fromkeys((edge.display, edge.drive) for edge in probes.blur):
        display, drive = kind
        times = [
            edge.bet for edge in probes.blur
            if (edge.display, edge.drive) == kind and (edge.ahead, edge.behind) in GREYS
        ]  # fmt: skip
        if times:
            figures[f"mprt_ms_{drive or metric_key(display)}"] = _known(
                mprt(times) * 1e3, "ms", _NO_BLUR
            )
    for steady in probes.flicker:
        if steady.display != "spike":
            continue
        if steady.area == "pixel":
            if steady.rate == SPARSE:
                name = f"flicker_svm_{steady.drive}_sparse_pixel"
                figures[name] = _known(steady.figures.svm, "1", _NO_FLICKER)
            continue
        for name, value, unit in (
            ("percent", steady.figures.percent, "%"), ("index", steady.figures.index, "1"),
            ("svm", steady.figures.svm, "1"), ("visibility", steady.figures.visibility, "1"),
        ):  # fmt: skip
            if steady.rate == GREY and steady.drive == probes.drive:
                figures[f"flicker_{name}_spike"] = _known(value, unit, _NO_FLICKER)
            if steady.rate == SPARSE:
                figures[f"flicker_{name}_{steady.drive}_sparse"] = _known(value, unit, _NO_FLICKER)
    if probes.pst_lm is not None:
        figures["pst_lm_spike"] = _known(probes.pst_lm, "1", _NO_FLICKER)
    frames = figures.get("ebet_ms_120hz")
    spike = figures.get("ebet_ms_spike")
    if frames and spike and frames.value and spike.value:
        figures["blur_120hz_over_spike"] = Metric(frames.value / spike.value, "1")
    return figures
