"""What a link needs to know of the stream that it carries, whatever makes the stream."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from cosim import Clock, InputError
from link.section import LinkScenario, LinkSection
from scenarios.assemble.schema.scenario import Scenario, StreamScenario
from scenarios.assemble.source.feeds import THRESHOLD, Feed
from sensor.codec.packets.section import CodeSection
from sensor.sections.sensor import SensorSection

_TOLERANCE: Final = Scenario.model_fields["tolerance"].default
"""Tolerance of the link for a scenario without one: a recording has no error of its own."""
_NOISE_APART: Final = 0x9E3779B9
"""Added to the seed: the chips at both ends have noise of their own."""


@dataclass(frozen=True, eq=False)
class CarriedStream:
    """A stream of 1-bit planes for a link.

    Attributes:
        title, tolerance, seed: title, tolerance and seed of the scenario.
        code, link: its sections.
        chip: section of the chip that makes the stream; None for another source.
        feed: planes that are sent.
    """

    title: str
    tolerance: float
    seed: int
    code: CodeSection
    link: LinkSection
    chip: SensorSection | None
    feed: Feed

    @classmethod
    def of(cls, scenario: StreamScenario, feed: Feed) -> CarriedStream:
        """The stream of a scenario with a [link]."""
        assert scenario.link is not None and scenario.code is not None
        chip = getattr(scenario, "sensor", None)
        return cls(
            scenario.title, getattr(scenario, "tolerance", _TOLERANCE), scenario.seed,
            scenario.code, scenario.link, chip if isinstance(chip, SensorSection) else None, feed,
        )  # fmt: skip

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the stream."""
        return self.feed.shape

    @property
    def clock(self) -> Clock:
        return self.feed.clock

    @property
    def cycles(self) -> int:
        return self.feed.cycles

    @property
    def wait(self) -> int:
        """Largest wait in the send buffer, cycles."""
        return math.ceil(self.code.buffer * self.clock.hz)

    @property
    def pixel_cycles(self) -> int:
        return self.cycles * self.shape[0] * self.shape[1]

    @property
    def seconds(self) -> float:
        """Length of the stream, s."""
        return self.cycles / self.clock.hz

    def scenario(self) -> LinkScenario:
        """The link as a scenario of its own, with random numbers of its own. Raises InputError for
        keys of [link] that a link with a stream does not have."""
        link = self.link
        for name, value, plain in (
            ("file", link.file, None),
            ("loop", link.loop, None),
            ("size", link.size, type(link).model_fields["size"].default),
        ):
            if value != plain:
                raise InputError(
                    f"link.{name}", "absent in a link that carries a stream", f"{value}",
                    "leave it out: there is no file to send",
                )  # fmt: skip
        return LinkScenario(
            title=self.title, tolerance=self.tolerance, seed=(self.seed + _NOISE_APART) % 2**32,
            link=link.model_copy(update={"sensor": None, "join": 0.0}),
            sensor=self._receiver() if link.sensor is None else link.sensor,
        )  # fmt: skip

    def _receiver(self) -> SensorSection:
        """The chip at the far end where the scenario says none: that of the source, if it has one,
        with a hard reset."""
        own, rate = self.chip, f"{self.clock.hz} Hz"
        if own is None:
            return SensorSection(clock=rate, threshold=f"{THRESHOLD} e", reset="hard")
        return SensorSection(
            chip=own.chip, clock=rate, threshold=f"{own.threshold} e", reset="hard"
        )
