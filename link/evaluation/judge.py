"""What came of a transmission: errors beside theory, rates, delays, and the result."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, SpikeStream
from cosim.run.result import Metric, Result, Throughput
from cosim.spikes.viform import count_spikes
from link.air import image_of
from link.air.geometry import panel_corners
from link.evaluation.capacity import capacity_bps
from link.evaluation.cell_errors import cell_errors
from link.evaluation.delay import group_delays, link_latency
from link.evaluation.errors import Errors, count_errors
from link.evaluation.eye import Eye, open_eye
from link.evaluation.finished import LinkRun, SoftValues, Theory
from link.evaluation.given import given_by
from link.evaluation.light import cell_scene, cell_sight, transmission
from link.evaluation.rates import link_rates
from link.evaluation.reach import CellScene, Reach, predict_errors, reach
from link.layout import TRAINING
from link.run.prepare import PreparedLink, in_view
from link.setting import LEAD
from link.theory import clopper_pearson
from link.trial.check import LinkCheck
from link.trial.patches import true_timing
from link.verdict import Cause, Verdict

__all__ = ["judge_link"]

LEVEL = 0.999
"""Of the interval of the raw bit error rate."""
_UNLIKE = frozenset(
    {Cause.OUT_OF_VIEW, Cause.MIRRORED, Cause.OCCLUDED, Cause.WRONG_CLOCK, Cause.INTERRUPTED}
)
"""Causes that no closed form of a cell's errors has: nothing is foreseen of a link that they kept
from being read."""
_DISTANCES = 40
"""At which the rate is foreseen, from where the panel fills the view to thirty times the run's, and
at the run's."""


def _errors(run: PreparedLink, received: Any) -> Errors:
    """Decisions beside bits, over the symbols that the receiver has read in the mode sent in."""
    held = sorted(received.packed) if received.mode == run.mode else []
    symbols = [n for n in held if TRAINING <= n < run.sent.data_end]
    return count_errors(
        run.sent.bits, received.decided, run.sent.layout, symbols, run.sent.data_end - 1
    )


def _soft(run: PreparedLink, received: Any) -> SoftValues | None:
    """The receiver's sample of soft values, with what was sent there."""
    if received.mode != run.mode or not len(received.soft):
        return None
    symbol, cell = received.soft_at.T
    fine = (symbol >= TRAINING) & (symbol < run.sent.data_end)
    symbol, cell, soft = symbol[fine], cell[fine], received.soft[fine]
    on = np.empty(symbol.size, np.bool_)
    for each in np.unique(symbol):
        mine = symbol == each
        on[mine] = run.sent.bits(int(each), 1)[0, cell[mine]]
    return SoftValues(soft, on)


def _eye(run: PreparedLink, stream: SpikeStream, received: Any) -> Eye | None:
    """The eye, where the receiver has found the panel and its symbols in the mode sent in."""
    found, timing = received.registration, received.timing
    if received.mode != run.mode or found is None or timing is None:
        return None
    return open_eye(stream, run.sent.layout, found, timing, run.sent.bits, run.sent.data_end)


def _theory(
    scene: CellScene, run: PreparedLink, errors: Errors, received: Any, cause: Cause
) -> Theory:
    interval = None
    if errors.bits:
        low, high = clopper_pearson(errors.wrong, errors.bits, LEVEL)
        interval = float(low), float(high)
    soft = received.promise if received.mode == run.mode else None
    wide = scene.blur > run.mode.cell * scene.pixel
    unlike = not errors.bits and cause in _UNLIKE
    if not in_view(run.setting) or run.setting.aim.occluded > 0 or unlike:
        return Theory(soft, None, interval)
    if scene.reset != "hard" or wide or not errors.bits:
        return Theory(soft, predict_errors(scene, run.mode) or None, interval)
    timing = true_timing(run.setting, run.make_air().late, run.mode.ticks)
    found = cell_errors(cell_sight(run.setting, timing, run.sent.symbols), run.mode)
    return Theory(soft, found.rate, interval, (found.low, found.high))


def _reach(run: PreparedLink, scene: CellScene) -> list[Reach]:
    setting = run.setting
    here = setting.air.distance
    chip, panel, focal = setting.camera.chip, setting.panel, setting.optics.focal_length
    tight = setting.scale * max(panel.shape[0] / chip.height, panel.shape[1] / chip.width)
    fills = focal + (here - focal) * tight * (1 + 1e-9)
    nearest = min(max(fills, here / 10, 2.1 * focal), 29 * here)
    distances = np.unique([*np.geomspace(nearest, 30 * here, _DISTANCES), here])
    clear = transmission(setting, here)
    through = np.array([transmission(setting, d) / clear for d in distances])
    return reach(
        scene, run.mode, here, focal, distances, panel.clock.hz, (chip.height, chip.width), through,
    )  # fmt: skip


def _metrics(finished: LinkRun, run: PreparedLink) -> dict[str, Metric]:
    received, theory, rates = finished.received, finished.theory, finished.rates
    sent = run.sent.outbox.frames_by(run.sent.groups)
    right = received.frames_right
    listened = _listened(run, received)
    lost = max(listened - right, 0)
    low, high = theory.interval or (None, None)
    delays = finished.delays
    needed = received.frames_needed
    repair, fill = run.sent.outbox.frames_beyond(run.sent.groups)
    eye = finished.eye
    return {
        "raw_bps": Metric(rates.raw, "bit/s"),
        "coded_bps": Metric(rates.coded, "bit/s"),
        "goodput_bps": Metric(rates.goodput, "bit/s"),
        "capacity_bps": Metric(finished.capacity, "bit/s"),
        "ber": Metric(finished.errors.rate, "1"),
        "ber_low": Metric(low, "1"),
        "ber_high": Metric(high, "1"),
        "ber_theory": Metric(theory.closed, "1"),
        "ber_theory_low": Metric(theory.closed_interval and theory.closed_interval[0], "1"),
        "ber_theory_high": Metric(theory.closed_interval and theory.closed_interval[1], "1"),
        "ber_soft": Metric(theory.soft, "1"),
        "bits_compared": Metric(finished.errors.bits, "bits"),
        "fer": Metric(lost / listened if listened else None, "1"),
        "frames_sent": Metric(sent, "frames"),
        "frames_received": Metric(right, "frames"),
        "frames_lost": Metric(lost, "frames"),
        "frames_needed": Metric(needed, "frames"),
        "frames_repair": Metric(repair, "frames"),
        "frames_fill": Metric(fill, "frames"),
        "eye_height": Metric(None if eye is None else eye.height, "1"),
        "eye_width": Metric(None if eye is None else eye.width, "ticks"),
        "latency_us": Metric(float(np.median(delays)) / 1e6 if delays.size else None, "us"),
        "file_bytes": Metric(len(run.payload.data), "bytes"),
        "cell": Metric(run.mode.cell, "panel pixels"),
        "ticks": Metric(run.mode.ticks, "panel planes"),
        "parity": Metric(run.mode.parity, "bytes"),
        "f_number": Metric(run.setting.optics.f_number, "1"),
        "goodput_error": Metric(run.check.goodput if finished.delivered else None, "1"),
        "full_physics": Metric(_full_physics(run), "s"),
        **_compared(finished.check),
        "camera": Metric(finished.seconds["air"] + finished.seconds["sensor"], "s"),
    }


def _listened(run: PreparedLink, received: Any) -> int:
    """Frames sent while the receiver listened: all, unless it has ended with the file whole, as it
    does where nothing more of it is right. What it left alone is not lost."""
    groups = run.sent.groups
    if received.whole and received.instants:
        groups = min(groups, max(instant.group for instant in received.instants) + 1)
    return run.sent.outbox.frames_by(groups)


def _compared(check: LinkCheck) -> dict[str, Metric]:
    """How many bits stand behind the error, and what they say of single decisions."""
    paired = check.paired
    close = None if paired is None else paired.near
    return {
        "check_bits": Metric(None if paired is None else paired.bits, "bits"),
        "check_otherwise": Metric(
            None if paired is None else paired.more + paired.fewer, "bits"
        ),
        "check_otherwise_high": Metric(None if paired is None else paired.otherwise, "1"),
        "check_counted_high": Metric(None if paired is None else paired.counted[2], "half-widths"),
        "check_near": Metric(None if close is None else close.count, "bits"),
        "check_near_otherwise": Metric(
            None if close is None else close.more + close.fewer, "bits"
        ),
    }  # fmt: skip


def _full_physics(run: PreparedLink) -> float | None:
    """Seconds that the reference tier with every effect would take, from what the patches took."""
    chip = run.setting.camera.chip
    if run.check.full_ns is None:
        return None
    return run.check.full_ns * 1e-9 * run.cycles * chip.width * chip.height


def _image(stream: SpikeStream) -> npt.NDArray[np.float32]:
    cycles = max(stream.cycles - LEAD, 1)
    return (count_spikes(stream, min(LEAD, stream.cycles - 1), stream.cycles) / cycles).astype(
        np.float32
    )


def _outline(homography: npt.NDArray[np.float64], run: PreparedLink) -> npt.NDArray[np.float64]:
    corners = panel_corners(run.setting.optics) @ homography.T
    return np.asarray(corners[:, :2] / corners[:, 2:], np.float64)


def judge_link(
    run: PreparedLink, folder: Path, stream: SpikeStream, received: Any, verdict: Verdict,
    delivered: bool, seconds: dict[str, float], throughput: list[Throughput], began: float,
) -> LinkRun:  # fmt: skip
    """Everything that the documents tell. delivered: the bytes are those that were sent."""
    setting, layout = run.setting, run.sent.layout
    camera = setting.camera
    verified = {each.group: each.tick for each in received.instants if each.right}
    done = None
    if delivered and received.delivered_tick is not None:
        done = (camera.clock.edge(received.delivered_tick + 1) - setting.first_light) / PS
    scene = cell_scene(setting)
    errors, eye = _errors(run, received), _eye(run, stream, received)
    check = run.check.met(errors.rate, errors.bits)
    truth = image_of(setting.optics, setting.aim, setting.air, stream.shape)
    outline = None
    if received.registration is not None and received.mode == run.mode:
        outline = _outline(received.registration.homography, run)
    if throughput:
        bits = len(run.payload.data) * 8 / max(seconds["receiver"], 1e-9)
        throughput = [*throughput, Throughput("receiver", bits, "bit/s")]
    result = Result(
        scenario=run.name,
        outcome="failed" if not delivered else "degraded" if run.short else "ok",
        seed=run.scenario.seed,
        device=run.device.name if run.device is not None else "numba on this processor",
        simulated_s=run.cycles / camera.clock.hz,
        tolerance=run.scenario.tolerance,
        error=check.error,
        kept=run.plan.kept,
        left_out=run.plan.documents(check.measured),
        latency=link_latency(setting, layout, verified),
        throughput=throughput,
        files=["scenario.toml", "stream.zarr"],
    )
    finished = LinkRun(
        result, run.scenario, folder, setting, run.payload, run.mode, layout, verdict, delivered,
        received, errors, _theory(scene, run, errors, received, verdict.cause),
        link_rates(layout, setting.panel.clock, len(run.payload.data), done), eye,
        _soft(run, received), _image(stream),
        outline, _outline(truth, run), group_delays(setting, layout, verified), scene,
        _reach(run, scene),
        capacity_bps(given_by(setting, scene, run.mode)) if in_view(setting) else None,
        seconds, began, check, run.choice,
        [*run.notes, *run.short, f"{verdict.cause.value}: {verdict.told}"],
    )  # fmt: skip
    result.metrics = _metrics(finished, run)
    return finished
