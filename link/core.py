"""A link that is called: bytes in, bytes out, in memory.

The link is set up once: the mode is chosen from pilots, and the camera's clock is locked to the
panel. A call codes its bytes, films the panel, and reads the spikes with a receiver that is given
nothing else. A run does the same around it with a recorder and a check of the plan, so call 0 has
the bits of a run of the same seed.

The noise of a call is a function of the seed and of the number of the call alone: that of air and
camera, and of the loop that holds the clock. The panel, its phase at the begin and the fixed
pattern of the camera stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Final

import numpy as np

from cosim.compute.memory import check_memory
from cosim.compute.opencl import Device
from cosim.compute.philox import seed_of
from cosim.plan.error import Bounds
from cosim.run.progress import QuietProgress
from cosim.spikes.viform import WORD, Viform, words_for
from cosim.stage import BLOCK, blocks
from link.evaluation.errors import errors_of
from link.evaluation.reception import arrival_of, judge_delivery, receive_stream
from link.mode import Mode, Modem
from link.plan.plan import LinkPlan, LinkSurvey
from link.plan.planned import PlannedLink, plan_link
from link.prediction.rates import link_rates
from link.receiving import Received
from link.receiving.tuned import Tuned
from link.setting import LinkSetting, Payload
from link.setup.setup import FileSetup, choose_link
from link.verdict import Verdict
from sensor.device.chips import ClockSteering
from sensor.latched.stages import DuplicatedRows
from sensor.latched.tiers import Tier

_PLANS: Final = 8
"""Plans that are kept."""
_STEADY: Final = 0.1
"""Shake of the image, standard deviation in camera pixels, from which every call searches. At .05 a
receiver that knows the link has up to a fifth more wrong decisions, at .2 two thirds more: the laws
of its detector are those of another place."""
_REHEARSAL: Final = 2**64 - 1
"""Number of the call whose noise the rehearsal has."""
_NAME: Final = "data"
"""Name of the bytes of a call, which the receiver reads."""


@dataclass(frozen=True, kw_only=True)
class LinkBounds(Bounds):
    """What a plan promises of the error of a simulation against full physics, before anything is
    measured: `bound` is that of the bit error rate, and `left_out` and `tolerance` are in
    half-widths of its interval.

    Attributes:
        tier: Tier of the pixels.
    """

    tier: Tier

    @classmethod
    def of_plan(cls, plan: LinkPlan) -> LinkBounds:
        """The bounds of a plan."""
        rows = {row.effect: row.bound for row in plan.plan.absent}
        return cls(
            bound=plan.promised, kind="estimate", left_out=rows, kept=plan.plan.everywhere,
            tolerance=plan.plan.tolerance, tier=plan.tier,
        )  # fmt: skip


@dataclass(frozen=True, repr=False)
class Crossed:
    """What became of the bytes of a call.

    Attributes:
        received: Bytes that have arrived; empty unless all have, as they were sent.
        intact: Whether they have arrived as they were sent.
        verdict: Cause of a failure, in a sentence.
        ber: Share of wrong decisions on cells, before any code; None if nothing was compared.
        bits: Number of bits compared.
        goodput_bps: Bits of the bytes over the time from first light to the last one that is
            verified, bit/s; None unless they have arrived.
        raw_bps: Bits of all data cells, bit/s.
        simulated_s: Time of the simulated machine, s.
        mode: Mode of the transmission.
        error: Bounds of the error of the simulation.
        notes: What a user must know of the link.
    """

    received: bytes
    intact: bool
    verdict: str
    ber: float | None
    bits: int
    goodput_bps: float | None
    raw_bps: float
    simulated_s: float
    mode: Mode
    error: LinkBounds
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        size = f"{len(self.received):,} bytes arrived" if self.intact else "nothing arrived"
        rate = "" if self.goodput_bps is None else f" at {self.goodput_bps / 1e9:.3g} Gbit/s"
        wrong = "unknown" if self.ber is None else f"{self.ber:.2g}"
        return f"Crossed: {size}{rate}, bit error rate {wrong}: {self.verdict}"


class LinkCore:
    """A link with its mode and its lock, ready to be called from any thread.

    Args:
        setting: panel, lens, air and camera with every effect; its seed is that of call 0.
        modem: how bytes become planes.
        steering: Steering of its clock; None for ticks that keep their length.
        device: OpenCL device, or None for the compiled form on the processor.
        size: bytes of a call for which the mode is chosen.
        tolerance: Change of the bit error rate at most, half-widths of its 99.9 % interval; 0 keeps
            every effect.
        duplicated_rows: fault of the readout, pairs (source, target).

    Attributes:
        chosen: the link without data.

    Raises:
        InputError: the link cannot be simulated.
    """

    def __init__(
        self, setting: LinkSetting, modem: Modem, steering: ClockSteering | None,
        device: Device | None, *, size: int, tolerance: float,
        duplicated_rows: Sequence[tuple[int, int]] = (),
    ) -> None:  # fmt: skip
        self.chosen = choose_link(
            modem, setting, steering, tolerance, size, device, QuietProgress()
        )
        self._duplicated = duplicated_rows
        self._plans: dict[tuple[int, int], tuple[LinkSurvey, LinkPlan]] = {}
        self._tuned: tuple[Tuned | None] | None = None
        self._lock, self._rehearsing = Lock(), Lock()

    @property
    def mode(self) -> Mode:
        """The mode of all calls."""
        return self.chosen.mode

    def forget(self) -> None:
        """Gives back what is kept for later calls."""
        with self._lock:
            self._plans = {}
        with self._rehearsing:
            self._tuned = None

    def _planned(self, setup: FileSetup) -> PlannedLink:
        """The planned link of a call. Calls of the same length share a plan."""
        key = setup.symbols, setup.cycles
        with self._lock:
            known = self._plans.get(key)
        if known is None:
            made = plan_link(setup)
            known = made.survey, made.plan
            with self._lock:
                self._plans = dict([*self._plans.items()][1 - _PLANS :]) | {key: known}
        survey, plan = known
        camera = setup.setting.camera.without(plan.left_out)
        return PlannedLink(setup, survey, replace(plan, camera=camera))

    def _film(self, link: PlannedLink) -> Viform:
        """The spikes of a transmission."""
        cycles, chip = link.setup.cycles, link.setup.setting.camera.chip
        shape = chip.height, chip.width
        check_memory(
            f"the spikes of {cycles:,} cycles", 4 * words_for(cycles) * shape[0] * shape[1],
            "send fewer bytes at once",
        )  # fmt: skip
        air = link.make_air()
        camera = link.make_camera(air.row_delay)
        readout = DuplicatedRows(self._duplicated) if self._duplicated else None
        words = np.empty((words_for(cycles), *shape), np.uint32)
        for block in blocks(cycles, BLOCK):
            part = camera.step(air.step(None, block), block)
            if readout is not None:
                part = readout.step(part, block)
            words[block.start // WORD : block.start // WORD + len(part.words)] = part.words
        return Viform(words, cycles, link.setup.setting.camera.clock)

    def _receive(
        self, link: PlannedLink, tuned: Tuned | None = None
    ) -> tuple[Received, Tuned | None]:
        setup = link.setup
        return receive_stream(self._film(link), setup.modem, setup.device, QuietProgress(), tuned)

    def _rehearsed(self) -> Tuned | None:
        """What the receiver knows of the link from a transmission of a byte with noise of its own;
        None if it could not be received, or the image shakes. All calls but the first begin with
        it."""
        if self.chosen.setting.aim.vibration > _STEADY:
            return None
        with self._rehearsing:
            if self._tuned is None:
                setup = self._setup(b"0", _REHEARSAL)
                self._tuned = (self._receive(self._planned(setup))[1],)
            return self._tuned[0]

    def _setup(self, data: bytes, number: int) -> FileSetup:
        seed = seed_of(self.chosen.setting.air.seed, number)
        return self.chosen.file(Payload(_NAME, data), QuietProgress(), seed=seed)

    def send(self, data: bytes, number: int = 0) -> Crossed:
        """Sends bytes.

        Args:
            data: bytes to send, at least one.
            number: number of the call, below 2^64.

        Raises:
            InputError: memory is short.
        """
        setup = self._setup(data, number)
        link = self._planned(setup)
        tuned = self._rehearsed() if number else None
        received = self._receive(link, tuned)[0]
        verdict, intact = judge_delivery(setup, received)
        errors = errors_of(setup, received)
        rates = link_rates(
            setup.sent.layout, setup.setting.panel.clock, len(data),
            arrival_of(setup, received) if intact else None, setup.sent.outbox.word_rate,
        )  # fmt: skip
        return Crossed(
            received.delivered[0] if intact and received.delivered else b"", intact,
            _said(verdict), errors.rate, errors.bits, rates.goodput, rates.raw,
            setup.cycles / setup.setting.camera.clock.hz, setup.mode, LinkBounds.of_plan(link.plan),
            tuple(setup.notes()),
        )  # fmt: skip


def _said(verdict: Verdict) -> str:
    return f"{verdict.cause.value}: {verdict.text}"
