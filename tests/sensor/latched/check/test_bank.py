"""What the bank changes, measured on patches: numbers of a known law, and banks that are wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.compute.opencl import Device
from sensor.latched.check.plan_check import bank_change
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


SETS = ("sensor.threshold=1 ke", "scene.illuminance=20 klx", "duration=5 ms")


def without_noise(bank: Bank) -> Bank:
    mean = np.full_like(bank.values, round(float(bank.values[:4096].mean())))
    return replace(bank, values=mean)


def too_long(bank: Bank) -> Bank:
    return replace(bank, values=bank.values + bank.values // 50)


@pytest.mark.parametrize("wrong", [None, without_noise, too_long])
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
    if wrong is None:
        assert measured == 0 and found == []
    else:
        assert measured > 1e-3 and found == [OWN_DRAWS]
