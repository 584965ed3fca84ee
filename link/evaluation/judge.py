"""Evaluation of a reception: errors against theory, rates, delays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import SpikeStream
from cosim.compute.stopping import threads
from cosim.compute.table_cache import cached_value
from cosim.plan.error import CONFIDENCE
from cosim.spikes.viform import count_spikes
from link.air import image_of
from link.air.geometry import panel_corners
from link.evaluation.delay import group_delays, link_latency
from link.evaluation.errors import Errors, errors_of
from link.evaluation.eye import Eye, open_eye
from link.evaluation.reception import arrival_of, judge_delivery
from link.evaluation.record import LinkEvaluation, SoftValues, Theory
from link.layout import TRAINING
from link.plan.planned import PlannedLink
from link.prediction.capacity import capacity_bps, capacity_input
from link.prediction.cell_errors import cell_errors
from link.prediction.chain_errors import chain_errors
from link.prediction.drawn_cells import CellErrors
from link.prediction.error_bound import CellScene, predict_errors
from link.prediction.light import cell_scene, cell_sight
from link.prediction.rates import link_rates
from link.receiving import Received
from link.setting import LEAD
from link.setup.locking.loop import SOURCES
from link.setup.setup import FileLinkSetup
from link.setup.truth import panel_in_view, true_timing
from link.theory import clopper_pearson
from link.verdict import Cause

Predicted = Callable[[], CellErrors | None]
_NOT_MODELLED: Final = frozenset(
    {Cause.OUT_OF_VIEW, Cause.MIRRORED, Cause.OCCLUDED, Cause.WRONG_CLOCK, Cause.INTERRUPTED}
)
"""Causes of failure that the closed forms of a cell's errors do not model."""


def _soft(setup: FileLinkSetup, received: Received) -> SoftValues | None:
    """Receiver's sample of soft values with the sent bits."""
    if received.mode != setup.mode or not len(received.soft):
        return None
    symbol, cell = received.soft_at.T
    of_data = (symbol >= TRAINING) & (symbol < setup.sent.data_end)
    symbol, cell, soft = symbol[of_data], cell[of_data], received.soft[of_data]
    on = np.empty(symbol.size, np.bool_)
    for each in np.unique(symbol):
        mine = symbol == each
        on[mine] = setup.sent.bits(int(each), 1)[0, cell[mine]]
    return SoftValues(soft, on)


def _eye(setup: FileLinkSetup, stream: SpikeStream, received: Received) -> Eye | None:
    """Eye diagram, if the receiver has located the panel and its symbols in the sent mode."""
    registration, timing = received.registration, received.timing
    if received.mode != setup.mode or registration is None or timing is None:
        return None
    sent = setup.sent
    return open_eye(stream, sent.layout, registration, timing, sent.bits, sent.data_end)


def closed_form(setup: FileLinkSetup, link: PlannedLink) -> CellErrors | None:
    """Predicted errors of the link's cells; None if the exact law of spikes does not apply. It
    needs no reception, and takes about as long as one: it is kept for the next run of the link."""
    mode, setting, scene = setup.mode, setup.setting, cell_scene(setup.setting)
    wide = scene.blur > mode.cell * scene.pixel
    if scene.reset != "hard" or wide or not panel_in_view(setting) or setting.aim.occluded > 0:
        return None
    rows, symbols = link.make_air().row_delay, setup.sent.symbols
    of = chain_errors if mode.ticks == 1 else cell_errors
    return cached_value(
        "cells", (setting, mode, rows, symbols), SOURCES, CellErrors,
        lambda: of(cell_sight(setting, true_timing(setting, rows, mode.ticks), symbols), mode),
    )  # fmt: skip


def _theory(
    setup: FileLinkSetup, closed: Predicted, scene: CellScene, errors: Errors, received: Received,
    cause: Cause,
) -> Theory:  # fmt: skip
    interval = None
    mode, setting = setup.mode, setup.setting
    if errors.bits:
        low, high = clopper_pearson(errors.wrong, errors.bits, CONFIDENCE)
        interval = float(low), float(high)
    soft = received.promise if received.mode == mode else None
    not_modelled = not errors.bits and cause in _NOT_MODELLED
    if not panel_in_view(setting) or setting.aim.occluded > 0 or not_modelled:
        return Theory(soft, None, interval)
    cells = closed() if errors.bits else None
    if cells is None:
        return Theory(soft, predict_errors(scene, mode) or None, interval)
    return Theory(soft, cells.rate, interval, (cells.low, cells.high))


def _image(stream: SpikeStream) -> npt.NDArray[np.float32]:
    cycles = max(stream.cycles - LEAD, 1)
    return (count_spikes(stream, min(LEAD, stream.cycles - 1), stream.cycles) / cycles).astype(
        np.float32
    )


def _outline(homography: npt.NDArray[np.float64], setup: FileLinkSetup) -> npt.NDArray[np.float64]:
    corners = panel_corners(setup.setting.optics) @ homography.T
    return np.asarray(corners[:, :2] / corners[:, 2:], np.float64)


def evaluate_link(
    setup: FileLinkSetup, link: PlannedLink, stream: SpikeStream, received: Received,
    closed: Predicted,
) -> LinkEvaluation:  # fmt: skip
    """Compares a reception with what was sent. closed: gives the result of `closed_form`."""
    with threads(1) as beside:  # neither of the two loads two cores
        eye = beside.submit(_eye, setup, stream, received)
        return _evaluated(setup, link, stream, received, closed, eye.result)


def _evaluated(
    setup: FileLinkSetup, link: PlannedLink, stream: SpikeStream, received: Received,
    closed: Predicted, eye: Callable[[], Eye | None],
) -> LinkEvaluation:  # fmt: skip
    """`evaluate_link`. eye: gives the eye diagram."""
    assert link.check is not None
    setting, layout = setup.setting, setup.sent.layout
    verdict, delivered = judge_delivery(setup, received)
    verified = {each.group: each.tick for each in received.instants if each.right}
    seconds = arrival_of(setup, received) if delivered else None
    scene = cell_scene(setting)
    errors = errors_of(setup, received)
    truth = image_of(setting.optics, setting.aim, setting.air, stream.shape)
    outline = None
    if received.registration is not None and received.mode == setup.mode:
        outline = _outline(received.registration.homography, setup)
    capacity = None
    if panel_in_view(setting):
        capacity = capacity_bps(capacity_input(setting, scene, setup.mode))
    return LinkEvaluation(
        setup=setup,
        link=link,
        check=link.check.rescaled(errors.rate, errors.bits),
        verdict=verdict,
        delivered=delivered,
        received=received,
        errors=errors,
        theory=_theory(setup, closed, scene, errors, received, verdict.cause),
        rates=link_rates(
            layout,
            setting.panel.clock,
            len(setup.payload.data),
            seconds,
            setup.sent.outbox.word_rate,
        ),
        soft=_soft(setup, received),
        image=_image(stream),
        outline=outline,
        truth=_outline(truth, setup),
        delays=group_delays(setting, layout, verified),
        latency=link_latency(setting, layout, verified),
        scene=scene,
        capacity=capacity,
        eye=eye(),
    )
