"""Evaluation of a stream that crossed a link: what it cost in picture, in time and in bits."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream
from cosim.config.amounts import number, percent
from cosim.files import ZarrStream
from cosim.run.machine import Outcome
from cosim.run.result import Latency, Metric, Throughput, latency_rows
from cosim.spikes.viform import words_for
from display.chain.display import DisplayChain
from display.probes.latency import PARTS, spike_latency
from display.probes.latency import Latency as StepLatency
from display.probes.metrics import DIM, GREY, NAMES, WHITE
from display.probes.setup import ProbeCamera
from link.evaluation.delay import LIGHT
from link.evaluation.metrics import lock_metrics
from link.receiving import Received
from link.verdict import Cause
from scenarios.assemble.behind.link.coding import Counts
from scenarios.assemble.behind.link.ends import FarEnd, NearEnd
from scenarios.assemble.behind.link.rates import RatePoint, code_rates
from scenarios.assemble.behind.link.stream_link import LINK_STREAM, RECEIVED, StreamLink
from scenarios.assemble.schema.scenario import ImageSection
from scenarios.assemble.source.feeds import Feed
from sensor.reconstruct.fidelity import judge, psnr, to_white
from sensor.reconstruct.playback import tfp
from sensor.reconstruct.shots import LATCHED, Shot, Truth, spike_rate, take_shots

WATCHED: Final = (DIM, GREY, WHITE)
"""Lights after a step that is watched through the whole chain, spikes a cycle."""
_PART = 8
"""Words that are compared at a time."""


@dataclass(frozen=True, eq=False)
class StreamLinkOutcome:
    """A link after its last block.

    Attributes:
        link: the stream link.
        lit: whether the truth of the images is the light of a scene.
        direct, through: images from the stream that was sent and from the decoded one.
        received: result of the receiver.
        near, far: the ends of the link.
        fidelity: a sentence on what is shown, beside what was sent.
        rates: every code at every rate, on a part of the stream.
        rated: cycle of the image of that part.
        views: data of the machine for its own page.
    """

    link: StreamLink
    lit: bool
    direct: list[Shot]
    through: list[Shot]
    received: Received
    near: NearEnd
    far: FarEnd
    fidelity: str
    rates: list[RatePoint]
    rated: int
    views: object


@dataclass(frozen=True, eq=False)
class Watch:
    """How the pictures at both ends of a link are taken.

    Attributes:
        feed: the source; the true light is that of its scene.
        instants: cycles of the images.
        image: the window of the images.
        display: the display at the far end; None for none.
        probe: the source in the small, for the display's probes; None if it has none.
        before: latencies of the source, up to the stream.
        after: latencies of the display, if it has no probe.
    """

    feed: Feed
    instants: list[int]
    image: ImageSection
    display: DisplayChain | None = None
    probe: ProbeCamera | None = None
    before: Sequence[Latency] = ()
    after: Sequence[Latency] = ()


@dataclass(frozen=True, eq=False)
class _Sent:
    """The TFP of a stream in the place of its true light, which nobody knows."""

    stream: SpikeStream
    watch: Watch

    def truth(self, ps: int) -> npt.NDArray[np.float32]:
        image = self.watch.image
        mean = tfp(
            self.stream, self.stream.clock.cycle_at(ps), image.window, preceding=image.preceding
        )
        return to_white(mean, self.watch.feed.white_rate).astype(np.float32)


def _differences(sent: SpikeStream, shown: SpikeStream) -> tuple[int, int]:
    """Spikes of the first stream that the second lacks in their cycle, and spikes that only the
    second has."""
    lost = added = 0
    for first in range(0, words_for(sent.cycles), _PART):
        a, b = (each.read_words(first, first + _PART) for each in (sent, shown))
        lost += int(np.bitwise_count(a & ~b).sum(dtype=np.int64))
        added += int(np.bitwise_count(b & ~a).sum(dtype=np.int64))
    return lost, added


def _fidelity(watch: Watch, spikes: float, lost: int, added: int) -> str:
    """How what is shown differs from what was sent. spikes: number of those sent."""
    what = "the stream that arrived" if watch.display is None else "the picture at the display"
    whose = "the recording's" if watch.feed.scene is None else "the camera's"
    if not lost and not added:
        return f"{what} is exactly {whose}: every spike in its cycle, and no other"
    share = percent(lost / max(spikes, 1))
    return f"{what} is not exactly {whose}: {share} of the spikes are not shown in their cycle"


def _psnr(shots: Sequence[Shot]) -> Metric:
    """PSNR of the rows that are read in the whole window."""
    seen = [shot.read for shot in shots if shot.rows[0] < shot.rows[1]]
    return judge(seen, LATCHED)["tfp_psnr"]


def _said(count: Counts) -> dict[str, Metric]:
    """What the source said beyond its spikes; nothing if it said nothing."""
    if not count.ancillary_bytes + count.ancillary_dropped:
        return {}
    return {
        "ancillary_bytes": Metric(count.ancillary_bytes, "bytes"),
        "ancillary_dropped": Metric(count.ancillary_dropped, "packets"),
    }


def _typical(shots: Sequence[Shot]) -> Shot:
    """The image of median fidelity: the one in the middle of a run may be that of a step."""
    return sorted(shots, key=lambda shot: psnr(shot.tfp, shot.truth))[len(shots) // 2]


def _rows(stage: str, cycles: npt.ArrayLike, period_ps: float) -> list[Latency]:
    ps = np.asarray(np.rint(np.asarray(cycles, np.float64) * period_ps), np.int64)
    return latency_rows(stage, ps)


def _latency(link: StreamLink, far: FarEnd, period_ps: float) -> list[Latency]:
    """Time of each stage from the latch of a spike until it is shown, over all packets.

    A packet waits for the end of its group, in the send buffer, and is on the panel for the rest of
    its blocks; then it waits until its group is shown. Every spike takes the same time in all. The
    waits for the code and to be shown are those of a spike in the middle of its group. Light that
    is on its way for less than a tick is seen in the tick in which it is sent: the chip adds
    nothing, and what is left of the tick is waited.
    """
    setup, hold = link.setup, link.hold
    if not far.arrivals:
        return []
    group = link.group
    ends = np.array([end for _, _, end in far.arrivals], np.int64) + setup.lead
    middles = (np.maximum(ends - group, setup.lead) + ends) / 2
    ticks = np.array([tick for tick, _, _ in far.arrivals], np.int64)
    begun = np.array([setup.first_cycle(setup.block_until(int(tick))) for tick in ticks])
    flight = setup.setting.air.distance / LIGHT * 1e12 / period_ps
    panel = setup.block_cycles
    seen = begun + panel + flight
    read = np.maximum(ticks - seen, 0.0)
    return [
        *_rows("code", [0, group / 2, group], period_ps),
        *_rows("send buffer", begun - ends, period_ps),
        *_rows("panel", [panel], period_ps),
        *_rows("air", [flight], period_ps),
        *_rows("link chip", read, period_ps),
        *_rows("wait to be shown", middles + hold - seen - read, period_ps),
    ]


def _watched(link: StreamLink, watch: Watch) -> list[StepLatency]:
    """Steps of light from the dark, filmed, coded with the link's share of bits, decoded and shown:
    the time until the display has gone half way, without the hold of the link. [] without a display
    or a camera to probe it with."""
    if watch.display is None or watch.probe is None:
        return []
    panel = watch.display.panel
    rows = spike_latency(link.probe(watch.probe), panel, WATCHED, watch.probe.seed)
    return [row for row in rows if row.drive == panel.drive and row.way == "rise"]


def stream_link_speeds(link: StreamLink, spent: Mapping[str, float]) -> list[Throughput]:
    """Speeds of the stages of a link. spent: wall time of each stage, s."""
    setup = link.setup
    return [
        Throughput("code", link.stream.pixel_cycles / spent["code"], "pixel-cycles/s"),
        Throughput("air", setup.symbols * setup.mode.ticks / spent["air"], "planes/s"),
        Throughput("link.sensor", setup.pixel_cycles / spent["link.sensor"], "pixel-cycles/s"),
        Throughput("receiver", setup.cycles / spent["receiver"], "planes/s"),
    ]


def judge_stream_link(
    link: StreamLink, watch: Watch, stages: Mapping[str, Any], sent: Path,
    seconds: dict[str, float], outcome: Outcome,
) -> Outcome:  # fmt: skip
    """The outcome of a run with a link.

    Args:
        link: the stream link.
        watch: how pictures are taken at both ends.
        stages: stages of the whole chain, after its last block.
        sent: recording of the stream that was sent, in the folder of the run.
        seconds: wall time of each stage, s; that of the rates is added.
        outcome: outcome of the source and the display, which shows the decoded stream.
    """
    near, far = stages["code"], stages["receiver"]
    received = far.receiver.received
    assert received is not None
    stream, clock = link.stream, link.stream.clock
    streams = [ZarrStream(sent), ZarrStream(sent.with_name(RECEIVED))]
    scene: Truth | None = watch.feed.source
    lit, truth = scene is not None, scene or _Sent(streams[0], watch)
    direct, through = (
        take_shots(
            each, truth, watch.instants, watch.image.window, watch.feed.white_rate,
            preceding=watch.image.preceding, registers=watch.feed.registers,
        )
        for each in streams
    )  # fmt: skip
    lost, added = _differences(*streams)
    rate = spike_rate(streams[0])
    fidelity = _fidelity(watch, rate * stream.pixel_cycles, lost, added)
    count = near.sender.counts
    on_time = sum(size for _, size, _ in far.arrivals)
    hold_us = link.hold * 1e6 / clock.hz
    watched = _watched(link, watch)
    photon = {
        f"latency_photon_{NAMES[row.rate]}_us": Metric(
            row.total.median + hold_us, "us", "no pixel responds within the probe"
        )
        for row in watched
    }
    rows = [
        Latency(stage, part.low, part.median, part.high)
        for row in watched
        if row.rate == GREY
        for stage, part in zip(PARTS, row.parts, strict=True)
    ]
    latency = [*watch.before, *_latency(link, far, 1e12 / clock.hz)]
    metrics = {
        **outcome.metrics,
        "spike_rate": Metric(rate, "spikes/cycle"),
        "psnr_direct": _psnr(direct)
        if lit
        else Metric(None, "dB", "no image has light within the run"),
        "psnr_through_link": _psnr(through)
        if lit
        else Metric(None, "dB", "no image has light within the run"),
        "stream_bps": Metric(8 * count.coded_bytes / stream.seconds, "bit/s"),
        "goodput_bps": Metric(8 * on_time / stream.seconds, "bit/s"),
        "link_bps": Metric(link.setup.rate * clock.hz, "bit/s"),
        "code_bits_per_pixel_cycle": Metric(8 * count.coded_bytes / stream.pixel_cycles, "bit"),
        "sent_bits_per_pixel_cycle": Metric(8 * on_time / stream.pixel_cycles, "bit"),
        "dropped_spikes": Metric(lost, "spikes"),
        "added_spikes": Metric(added, "spikes"),
        "packets_dropped": Metric(count.dropped, "packets"),
        "packets_late": Metric(far.late, "packets"),
        **_said(count),
        "tiles_missing": Metric(far.missing, "tiles"),
        "tiles_held": Metric(sum(held for _, _, held in far.gaps), "tiles"),
        "recovery_us": Metric(
            _recovery(link, far),
            "us",
            "no packet was missed, or the picture did not come back",
        ),
        "buffer_peak_bytes": Metric(count.peak_bytes, "bytes"),
        "latency_us": Metric(hold_us, "us"),
        "latency_photon_us": photon.get(
            f"latency_photon_{NAMES[GREY]}_us",
            Metric(None, "us", "the delay of light is not probed with this source"),
        ),
        **photon,
        "frames_received": Metric(received.frames_right, "frames"),
        "frames_lost": Metric(far.receiver.frames_lost, "frames"),
        "bytes_corrected": Metric(received.bytes_corrected, "bytes"),
        **lock_metrics(link.setup.lock),
    }
    begin = time.perf_counter()
    rated = _typical(direct)
    rates = code_rates(
        streams[0], rated, stream.code, stream.feed.threshold, stream.feed.noise,
        watch.image.window, rated.white,
    )  # fmt: skip
    seconds["rates"] = time.perf_counter() - begin
    worse = _causes(link, received, far, count)
    error = outcome.error
    if error.kind is not None and "behind a code" not in error.kind:
        error = replace(error, kind=f"{error.kind}; before the link")
    return replace(
        outcome,
        error=error,
        outcome="degraded" if worse and outcome.outcome == "ok" else outcome.outcome,
        kept=[*outcome.kept, *link.kept],
        left_out=[*outcome.left_out, *link.left_out],
        metrics=metrics,
        latency=[*latency, *(rows or watch.after)],
        files=[*outcome.files, LINK_STREAM, RECEIVED],
        notes=[*outcome.notes, *worse, *link.planned.beyond, fidelity],
        views=StreamLinkOutcome(
            link,
            lit,
            direct,
            through,
            received,
            near,
            far,
            fidelity,
            rates,
            rated.cycle,
            outcome.views,
        ),
    )


def _recovery(link: StreamLink, far: FarEnd) -> float | None:
    """Time from the end of the last blockage, or from the receiver's first cycle if it joins late,
    to the filming of the first group that is shown whole from then on, us; None without either."""
    clock, lead = link.stream.clock, link.setup.lead
    blocked = link.setup.setting.aim.blocked
    ends = [clock.cycle_at(stop) - lead for _, stop in blocked]
    if link.joins:
        ends.append(link.joins - lead)
    if not ends:
        return None
    if not far.gaps:
        return 0.0
    whole = far.gaps[-1][0] + link.group
    return max(whole - max(ends), 0) * 1e6 / clock.hz


def _causes(link: StreamLink, received: Received, far: FarEnd, count: Counts) -> list[str]:
    """What the stream has lost on its way, and why."""
    causes = []
    verdict = f"{received.verdict.cause.value}: {received.verdict.text}"
    lost = far.receiver.frames_lost
    if not received.instants:
        causes.append(f"nothing arrived over the link: {verdict}")
    elif lost and far.receiver.interruptions:
        spans = ", ".join(
            f"{number(link.stream_ms(low), 4)} to {number(link.stream_ms(high), 4)} ms"
            for low, high in far.receiver.interruptions
        )
        causes.append(f"the light of the link was interrupted at {spans}: {lost} frames were lost")
    elif lost:
        if received.verdict.cause is Cause.TRUNCATED:  # said of files: a stream has no end
            wrong, read = received.codewords_wrong, received.codewords
            verdict = f"{wrong} of {read} codewords could not be mended"
        causes.append(f"{lost} frames of the link were lost: {verdict}")
    if count.dropped:
        causes.append(
            f"{count.dropped} packets were not sent: the link carries less than the stream brings"
        )
    if count.ancillary_dropped:
        causes.append(
            f"{count.ancillary_dropped} packets of register writes or charges were not sent: the "
            "send buffer had no room for them"
        )
    if far.gaps:
        first, last = far.gaps[0][0], far.gaps[-1][0] + link.group
        hz = link.stream.clock.hz
        causes.append(
            f"{far.missing} tiles of groups were shown dark and "
            f"{sum(held for _, _, held in far.gaps)} with the rate that they had last, between "
            f"{number(first / hz * 1e3, 4)} and {number(last / hz * 1e3, 4)} ms of the stream"
        )
    return causes
