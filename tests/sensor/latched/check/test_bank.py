"""What the bank changes, measured on patches: numbers of a known law, and banks that are wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.compute.opencl import Device
from sensor.latched.check.law import LONGEST, Intervals, Spread, bank_change, law_change
from sensor.latched.effects.own_draws import OWN_DRAWS
from sensor.latched.fast import array
from sensor.latched.pixel.bank import Bank
from tests.scenarios.assemble.source.latched.test_plan_check import verifiers


@pytest.mark.parametrize(("rate", "noise"), [(0.0, 0.0), (0.01, 0.0), (0.0, 0.3)])
def test_known_changes_lie_within_their_intervals(rate: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    light = rng.uniform(0.1, 0.5, (1, 30, 1))
    own = light * (1 + 0.01 * rng.standard_normal((4, 30, 256)))
    bank = light * (1 + rate + 0.01 * (1 + noise) * rng.standard_normal((4, 30, 256)))
    change = bank_change(bank, own, np.broadcast_to(light, own.shape), 0.0)
    assert change is not None
    assert abs(change.rate - rate) < change.rate_width < 5e-4
    # (1 + noise)^2 - 1 over 2 and the mean size, which grows with the noise
    size = 0.01 * np.sqrt((1 + (1 + noise) ** 2) / 2)
    expected = 1e-4 * ((1 + noise) ** 2 - 1) / (2 * size)
    assert abs(change.noise - expected) < change.noise_width < 1e-3
    assert (change.least == 0) == (rate == noise == 0)
    assert change.value >= change.least


def test_a_single_patch_has_no_scatter() -> None:
    one, two = np.ones((3, 1, 256)), np.ones((3, 2, 256))
    assert bank_change(one, one, one, 0.0) is None
    same = bank_change(two, two, two, 0.0)
    assert same is not None and same.value == 0


def test_intervals_are_counted_across_steps_and_after_a_resumption() -> None:
    rng = np.random.default_rng(2)
    spikes = rng.random((200, 12)) < 0.2
    spikes[20:, 3] = False  # a pixel that ends dark
    whole, resumed = Intervals(3, 12), Intervals(3, 12)
    for start, stop in ((0, 70), (70, 71), (71, 200)):
        part = np.zeros((-(-(stop - start) // 32) * 32, 12), np.uint8)
        part[: stop - start] = spikes[start:stop]
        octets = np.packbits(part.reshape(-1, 32, 12), axis=1, bitorder="little")
        words = np.ascontiguousarray(octets.transpose(0, 2, 1)).view(np.uint32)[:, :, 0]
        whole.add(words, start, stop - start)
        resumed.add(words, start, stop - start)
        state, resumed = resumed.state(), Intervals(3, 12)
        resumed.restore(state)
    for patch in range(3):
        own = [np.diff(np.flatnonzero(spikes[:, 4 * patch + n])) for n in range(4)]
        expected = np.bincount(np.concatenate(own), minlength=LONGEST + 1)
        assert (whole.counts[patch] == expected).all()
    assert (resumed.counts == whole.counts).all()


@pytest.mark.parametrize(
    ("mean", "noise", "alike", "apart"),
    [(0, 1, 0, 0), (0.01, 1, 0, 0), (0, 1.2, 0, 0), (0, 1, 0.3, 0), (0, 1, 0, 0.05)],
)
def test_changes_of_a_law_lie_within_their_limits(
    mean: float, noise: float, alike: float, apart: float
) -> None:
    """Rates of known noise; intervals of 2 to 6 cycles, a share of which is one longer."""
    rng = np.random.default_rng(7)
    light, patches = 0.3, 20

    def seen(mean: float, noise: float, alike: float, apart: float) -> Spread:
        own, shared = (rng.standard_normal((8, patches, 16, n)) for n in (16, 1))
        rates = 0.03 * noise * (np.sqrt(1 - alike) * own + np.sqrt(alike) * shared)
        drawn = rng.integers(2, 7, (patches, 5000))
        drawn += (drawn == 6) & (rng.random(drawn.shape) < 5 * apart)
        counts = np.stack([np.bincount(each, minlength=9) for each in drawn])
        whole = light * (1 + mean) + rates.mean(axis=0).reshape(patches, -1)
        return Spread(whole, rates.reshape(8, patches, -1), counts, 16)

    law = law_change(seen(mean, noise, alike, apart), seen(0, 1, 0, 0), 0.0)
    truth = {
        "mean": mean, "variance": noise**2 - 1, "interval_tv": apart, "correlation": alike,
    }  # fmt: skip
    widths = {"mean": 1e-2, "variance": 0.09, "interval_tv": 0.08, "correlation": 0.06}
    for name, figure in vars(law).items():
        assert figure.ci[0] <= truth[name] <= figure.ci[1], name
        assert figure.ci[1] - figure.ci[0] < widths[name], name
        assert figure.ci[0] <= figure.value <= figure.ci[1], name


SETS = ("sensor.threshold=1 ke", "scene.illuminance=20 klx", "duration=5 ms")


def without_noise(bank: Bank) -> Bank:
    mean = np.full_like(bank.values, round(float(bank.values[:4096].mean())))
    return replace(bank, values=mean)


def too_long(bank: Bank) -> Bank:
    return replace(bank, values=bank.values + bank.values // 50)


def in_order(bank: Bank) -> Bank:
    """Neighbours draw nearly the same threshold: only their correlation is wrong."""
    values = np.sort(bank.values[:4096])
    return replace(bank, values=np.append(values, values[:16]))


BEYOND = {
    None: set(),
    without_noise: {"variance"},
    too_long: {"mean"},
    in_order: {"correlation"},
}
"""Figures whose limits do not include what a bank should have."""


@pytest.mark.parametrize("wrong", BEYOND)
def test_a_wrong_bank_is_found(device: Device, monkeypatch, wrong) -> None:
    if wrong is not None:
        right = array.bank_of
        monkeypatch.setattr(array, "bank_of", lambda model, bits: wrong(right(model, bits)))
    (check,) = verifiers(device, 0.01, [], sets=SETS)
    change = check.bank()
    assert OWN_DRAWS in check._plan.left_out and change is not None
    measured = check.measured()[OWN_DRAWS]
    assert measured == change.least
    found = [finding.effect for finding in check.shortfall("fast")]
    law = check.patches_law()
    assert law is not None and check._law is not None
    if wrong is None:
        assert measured == 0 and found == []
        assert all(f.ci[0] <= f.value <= f.ci[1] for f in vars(law).values())
    else:
        assert found == [OWN_DRAWS]
    beyond = {
        name for name, figure in vars(law).items()
        if not figure.ci[0] <= vars(check._law)[name].value <= figure.ci[1]
    }  # fmt: skip
    assert beyond >= BEYOND[wrong] and (wrong is not None or not beyond)
