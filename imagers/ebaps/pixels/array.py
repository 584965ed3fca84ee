"""Pixels of an EBAPS: from lux on the photocathode to 16-bit numbers.

Lateral spread between cathode and silicon is applied to the means of the photoelectrons. A
photoelectron gives all of its charge to one pixel, and photoelectrons land independently. Poisson
counts therefore remain Poisson and independent (thinning and superposition), and spreading the
means is exact also for the noise. Not modelled: diffusion of charge between pixels in the silicon,
which would correlate neighbours.

Outside the given rows and columns the light of the outermost pixel continues. A frame that is
computed in bands therefore differs from a whole frame near the edges of the bands.

Photoelectrons (Poisson) cross the gap. A share is lost, the others land near the point where they
started, and each makes a few hundred electrons; occasionally an ion adds a burst. Dark current and
light that passes the photocathode are added in the silicon. Full well, analog chain and converter
follow. At 0 V no photoelectron crosses, and the silicon sees only the light that passes the
photocathode.

Not modelled: charge that diffuses between pixels, lag, blooming, the photocathode's warming.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.draws import binomial, negative_binomial, normal, poisson
from cosim.compute.streams import Stream
from cosim.plan.effects import Effect
from imagers.common.frame_pixel import Conversion, digitised, summary_of
from imagers.ebaps.pixels.effects import Budget, ebaps_effects
from imagers.ebaps.pixels.silicon import Pattern, Silicon
from imagers.ebaps.pixels.tube import Spectral, Tube
from sensor.frame_pixels import Exposed, ImagerSummary

Values = npt.NDArray[np.float64]
_BLOCK = 2
"""Pixels along a side of the blocks that the halo is computed in: its disc is 28 pixels wide."""
COLUMNS, ROWS = 1280, 1024
"""Document 002, section 1.1."""
BITS = 16
"""Bits of the converter (CBM92AD68-80): document 002, section 1.3."""
_BURST = 1 << 40
"""Added to a frame's number where ion bursts take their size from the stream of ion events."""


@njit(cache=True, nogil=True)
def _landing(means, kernel, out):  # type: ignore[no-untyped-def]
    height, width = means.shape
    line = np.empty(width)
    for y in range(height):
        for x in range(width):
            line[x] = kernel[0] * means[y, x]
        for k in range(1, kernel.size):
            up, down = max(y - k, 0), min(y + k, height - 1)
            for x in range(width):
                line[x] += kernel[k] * (means[up, x] + means[down, x])
        for x in range(width):
            total = kernel[0] * line[x]
            for k in range(1, kernel.size):
                total += kernel[k] * (line[max(x - k, 0)] + line[min(x + k, width - 1)])
            out[y, x] = total


@njit(cache=True, nogil=True)
def _disc(means, half, out):  # type: ignore[no-untyped-def]
    """Half widths (pixels) of the rows of a disc, from the centre outward."""
    height, width = means.shape
    reach = half.size - 1
    side = half[0]
    padded = width + 2 * side + 1
    sums = np.zeros((height, padded))
    for y in range(height):
        total = 0.0
        for x in range(padded - 1):
            total += means[y, min(max(x - side, 0), width - 1)]
            sums[y, x + 1] = total
    count = 0
    for k in range(-reach, reach + 1):
        count += 2 * half[abs(k)] + 1
    for y in range(height):
        for x in range(width):
            out[y, x] = 0.0
        for k in range(-reach, reach + 1):
            row, w = sums[min(max(y + k, 0), height - 1)], half[abs(k)]
            for x in range(width):
                out[y, x] += row[x + side + w + 1] - row[x + side - w]
        for x in range(width):
            out[y, x] /= count


def landing(means: Values, kernel: Values) -> Values:
    """(rows, W) means, spread along both axes by a symmetric kernel that is given from its centre
    outward."""
    out = np.empty_like(means)
    _landing(np.ascontiguousarray(means), kernel, out)
    return out


def halo(means: Values, radius: float) -> Values:
    """(rows, W) means, spread uniformly over a disc, in blocks of 2 x 2 pixels. radius: pixels."""
    height, width = means.shape
    spare = ((0, -height % _BLOCK), (0, -width % _BLOCK))
    full = np.pad(means, spare, mode="edge") if any(n for _, n in spare) else means
    rows, columns = full.shape[0] // _BLOCK, full.shape[1] // _BLOCK
    blocks = full.reshape(rows, _BLOCK, columns, _BLOCK).mean(axis=(1, 3))
    size = radius / _BLOCK
    reach = int(size)
    half = np.array([int(math.sqrt(size**2 - k * k)) for k in range(reach + 1)], np.int64)
    out = np.empty_like(blocks)
    _disc(blocks, half, out)
    return out.repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)[:height, :width]


@dataclass(frozen=True, eq=False)
class EbapsPixels:
    """The pixels of an electron-bombarded active pixel sensor.

    Attributes:
        volts: magnitude of the high voltage, 0 to 1500.
        kelvin: temperature of the silicon.
        device: seed of the fixed pattern.
        spectral: electrons of the light over those of a lamp of 2856 K. The rest see `PixelModel`.
    """

    shape: tuple[int, int] = (ROWS, COLUMNS)
    volts: float = 1500.0
    kelvin: float = 300.0
    device: int = 1
    tube: Tube = field(default_factory=Tube)
    silicon: Silicon = field(default_factory=Silicon)
    bits: int = BITS
    spectral: Spectral = field(default_factory=Spectral)

    def __post_init__(self) -> None:
        if not 0 <= self.volts < math.inf:
            raise ValueError(f"high voltage must be 0 V or more in size, not {self.volts:g} V")
        if not 0 < self.kelvin < math.inf:
            raise ValueError(f"temperature must be above 0 K, not {self.kelvin:g} K")

    @property
    def full_scale(self) -> int:
        """DN."""
        return (1 << self.bits) - 1

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """See `PixelModel`."""
        return ebaps_effects(self.budget(0.0, 0.0), self.full_scale, float(self.kernel[0]) ** 2)

    @cached_property
    def kernel(self) -> Values:
        """Shares that land 0, 1, ... pixels away along one axis."""
        return self.tube.landing_kernel(self.volts, self.silicon.pitch)

    @cached_property
    def pattern(self) -> Pattern:
        """Fixed pattern of the device."""
        return Pattern(self.silicon, self.shape, self.device)

    def at(self, *, volts: float | None = None, kelvin: float | None = None) -> EbapsPixels:
        """The same device at another voltage or temperature, with the same fixed pattern."""
        other = copy.copy(self)
        object.__setattr__(other, "volts", self.volts if volts is None else volts)
        object.__setattr__(other, "kelvin", self.kelvin if kelvin is None else kelvin)
        other.__post_init__()
        other.__dict__["pattern"] = self.pattern
        for made in ("effects", "kernel"):
            other.__dict__.pop(made, None)
        return other

    @property
    def sensitivity(self) -> float:
        """Photoelectrons of a lux second in a pixel."""
        return self.tube.electrons_per_lux * self.silicon.area * self.spectral.photocathode

    def photoelectrons(self, lux_seconds: float) -> float:
        """Photoelectrons of an exposure in a pixel. lux_seconds: exposure, lx s."""
        electrons = lux_seconds * self.tube.electrons_per_lux * self.silicon.area
        return electrons * self.spectral.photocathode

    def budget(self, lux_seconds: float, seconds: float) -> Budget:
        """Closed form of a pixel without fixed pattern in uniform light."""
        light = self.photoelectrons(lux_seconds)
        return Budget(
            self.tube, self.silicon, self.volts, self.kelvin, light, seconds, self.spectral
        )

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`; the mean includes the black level."""
        budget = self.budget(lux_seconds, seconds)
        return float(self.silicon.black + budget.mean), float(budget.variance)

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`."""
        gain = self.tube.gain(self.volts)
        light = self.photoelectrons(lux_seconds[0]), self.photoelectrons(lux_seconds[1])
        return summary_of(
            light, seconds, frames, self.silicon.well, kelvin=self.kelvin, gain=(gain, gain),
            step=1 / self.silicon.dn_per_electron,
        )  # fmt: skip

    def _landed(self, light: Values, at: Conversion) -> Values:
        """Photoelectrons absorbed in each pixel, from the mean number emitted above it."""
        if "landing spread" in at.kept:
            light = landing(light, self.kernel)
        if "halo" in at.kept:
            share, radius = self.tube.halo, self.tube.halo_radius / self.silicon.pitch
            light = (1 - share) * light + share * halo(light, radius)
        stays = 1 - self.tube.loss
        loss = "electron loss" in at.kept
        if "shot noise" in at.kept:
            # Poisson thinned is Poisson: one draw serves both.
            mean = light * stays if loss else light
            counts = at.counts(mean, "shot noise", Stream.IMAGER_SHOT)
            return counts if loss else counts * stays
        if loss:
            whole = np.ceil(light)
            each = np.divide(light * stays, whole, out=np.zeros_like(light), where=whole > 0)
            return binomial(whole, each, at.numbers, at.frame, at.seed, Stream.IMAGER_LOSS).astype(
                np.float64
            )
        return light * stays

    def _bursts(self, landed: Values, at: Conversion) -> Values:
        """Electrons that ion events add: an independent geometric count (from 0) per event."""
        stream = Stream.IMAGER_IONS
        events = poisson(landed * self.tube.ions, at.numbers, at.frame, at.seed, stream)
        out = np.zeros(landed.shape)
        hit = events > 0
        if hit.any():
            out[hit] = negative_binomial(
                events[hit], self.tube.burst, at.numbers[hit], at.frame | _BURST, at.seed, stream
            )
        return out

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`. Electrons spread into neighbouring rows, so rows should be a whole
        frame; the module states the error at the edges of a part."""
        at = Conversion.of(rows, seed, kept)
        seconds = np.asarray(rows.seconds, np.float64)
        tube, silicon, gain = self.tube, self.silicon, self.tube.gain(self.volts)
        electrons = np.zeros(at.shape)
        if gain > 0:
            light = rows.lux_seconds * self.sensitivity
            if "photocathode emission" in kept:
                emitted = tube.emission_lux * tube.electrons_per_lux * silicon.area
                light = light + emitted * seconds[:, None]
            landed = self._landed(light, at)
            if "ion events" in kept:
                landed = landed + self._bursts(landed, at)
            electrons = landed * gain
            if "gain spread" in kept:
                spread = np.sqrt(landed * (gain * tube.gain_variance))
                spread *= normal(at.numbers, rows.frame, seed, Stream.IMAGER_GAIN)
                electrons += spread
        response = at.times(np.ones((at.shape[0], 1)), "PRNU", self.pattern.response)
        response = at.times(response, "stripes", self.pattern.stripes)
        electrons *= response
        gather = seconds + np.asarray(rows.waiting, np.float64)
        slow = at.dark(silicon.dark_rate(self.kelvin), gather, self.pattern.dark)
        if "direct light" in kept:
            leaked = silicon.direct * silicon.leakage * silicon.area * self.spectral.silicon
            slow = slow + rows.lux_seconds * leaked * response
        slow = at.counts(slow, "silicon shot noise", Stream.IMAGER_DARK)
        electrons = np.minimum(electrons + slow, silicon.well)
        if "offset FPN" in kept:
            electrons += at.part(self.pattern.offset())
        electrons = at.noisy(electrons, silicon.read_noise, "read noise", Stream.IMAGER_READ)
        return digitised(silicon.black + silicon.dn_per_electron * electrons, self.bits)
