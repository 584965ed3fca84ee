"""The stability suite: the shipped methods hold, and each case catches the naive method."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest

from cosim.compute.opencl import Device
from cosim.run.case import Case
from scenarios.studies.stability import CASES
from sensor.circuit.solvers import solved_train
from sensor.stability.chance import Z
from tests.scenarios.studies.stability import naive_methods as naive
from tests.scenarios.studies.stability import naive_solvers as solvers

FIELDS = ["case", "name", "holds", "value", "limit", "unit", "what", "reference", "seconds"]


def fails(number: int, method: Any, **size: Any) -> float:
    """The value of a case's own check on a naive method, which its own rule must refuse."""
    case = CASES[number]
    value = case.check(method, **(size or case.quick))
    assert not case.holds(value), (number, value)
    return float(value)


def test_every_case_of_the_table_is_here() -> None:
    assert list(CASES) == list(range(1, 39))
    for case in CASES.values():
        assert case.name and case.what and case.reference and case.guards and case.unit


@pytest.mark.slow
def test_all_cases_hold_in_full(viform: Callable[..., Any]) -> None:
    answer = viform("stability", "--json")
    rows = json.loads(answer.out)["rows"]
    assert [row["case"] for row in rows if not row["holds"]] == []
    assert answer.code == 0 and [row["case"] for row in rows] == list(CASES)


@pytest.mark.parametrize("number", CASES)
def test_the_method_that_ships_holds(number: int, device: Device) -> None:
    row = CASES[number].measure(device, quick=True)
    assert row.holds, row


@pytest.mark.parametrize("number", [1, 2, 6, 11])
def test_without_opencl_as_well(number: int) -> None:
    row = CASES[number].measure(None, quick=True)
    assert row.holds, row


class TestCommand:
    def test_prints_its_document_and_holds(self, viform: Callable[..., Any]) -> None:
        code, out, err = viform("stability", "--json", "11", 3)
        rows = json.loads(out)["rows"]
        assert code == 0 and [row["case"] for row in rows] == [11, 3]
        for row in rows:
            assert list(row) == FIELDS
            assert (row["holds"], row["value"], row["limit"]) == (True, 0, 0)
        assert "1/2 case 11, spike on a latch edge: holds" in err and "2/2 case 3" in err

    def test_prints_a_table(self, viform: Callable[..., Any]) -> None:
        code, out, _ = viform("stability", "11")
        assert code == 0 and "11 spike on a latch edge  holds" in out

    def test_says_no_when_a_case_fails(
        self, viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        good = CASES[11]
        bad = Case(**{**vars(good), "check": lambda method: math.inf})
        monkeypatch.setitem(CASES, 11, bad)
        code, out, _ = viform("stability", "--json", "11")
        (row,) = json.loads(out)["rows"]
        assert (code, row["holds"], row["value"]) == (1, False, None)
        code, out, _ = viform("stability", "11")
        assert code == 1 and "FAILS" in out

    @pytest.mark.parametrize("given", ["39", "0", "-3", "one", "1.5", ""])
    def test_refuses_a_case_that_is_none(self, refused: Callable[..., str], given: str) -> None:
        said = refused("stability", "--", "1", given)
        assert said.startswith("a case must be one of 1, 2, 3") and repr(given) in said


def test_no_number_is_no_pass() -> None:
    assert not CASES[1].holds(math.nan)


class TestNaive:
    """One naive method, at least, for each case; the same check, the same rule."""

    def test_case_1_float32_accumulator_fails(self) -> None:
        fails(1, naive.float32_accumulator)

    def test_case_2_float32_accumulator_fails(self) -> None:
        # Exact counts of 4e7 cycles are 1, 2, 5; float32 stops gathering the two dimmer lights.
        assert fails(2, naive.float32_counts) >= 1

    def test_case_3_stepping_fails(self) -> None:
        fails(3, naive.stepping_dark)

    def test_case_4_one_spike_a_cycle_fails(self) -> None:
        assert fails(4, naive.ONE_A_CYCLE) > 0.99

    def test_case_4_float32_time_fails(self) -> None:
        fails(4, naive.ONE_A_CYCLE._replace(rate=naive.float32_time))

    def test_case_5_normal_thresholds_fail(self) -> None:
        fails(5, naive.normal_thresholds, n=100_000)

    def test_case_6_noise_drawn_once_a_pixel_fails(self) -> None:
        assert fails(6, naive.noise_once_a_pixel) == math.inf

    def test_case_9_light_sampled_at_the_edges_fails(self) -> None:
        fails(9, naive.light_at_the_edges)

    def test_case_9_a_solver_not_restarted_at_the_flash_fails(self) -> None:
        assert fails(9, solvers.flash_not_restarted) == 1  # it misses all of it

    @pytest.mark.parametrize("way", ["float32", "both edges", "neither edge"])
    def test_case_11_lost_ties_fail(self, device: Device, way: str) -> None:
        fails(11, naive.tie_methods(CASES[11].shipped(device))[way])

    def test_case_17_squares_in_coulombs_fail(self) -> None:
        assert fails(17, naive.squares_in_coulombs) == 1

    @pytest.mark.parametrize("way", ["32-bit cycle", "float32 time", "32-bit spike index"])
    def test_case_18_counters_that_wrap_fail(self, device: Device, way: str) -> None:
        fails(18, naive.counter_methods(CASES[18].shipped(device))[way])

    def test_case_19_seed_plus_stream_fails(self) -> None:
        assert fails(19, naive.seed_plus_stream) > 10 * Z

    def test_case_20_numbers_drawn_in_order_fail(self) -> None:
        fails(20, naive.drawn_in_order)

    @pytest.mark.parametrize("way", ["plain_log", "float32_time", "in_coulombs"])
    def test_case_7_times_that_lose_digits_fail(self, way: str) -> None:
        fails(7, getattr(solvers, way))

    def test_case_8_a_solver_not_restarted_at_the_step_fails(self) -> None:
        fails(8, solvers.through_the_step)

    def test_case_8_the_same_solver_restarted_holds(self) -> None:
        def restarted(*problem: Any) -> Any:
            return solved_train(*problem, solver="LSODA", tolerance=1e-10)

        assert CASES[8].holds(CASES[8].check(restarted))

    def test_case_10_light_of_a_cycle_as_at_its_edge_fails(self, device: Device) -> None:
        shipped = CASES[10].shipped(device)
        fails(10, naive.held_for_a_cycle(shipped))

    def test_case_12_no_time_to_decide_fails(self) -> None:
        assert fails(12, naive.no_time_to_decide) > 10 * Z

    @pytest.mark.parametrize("way", ["step_by_step", "in_coulombs"])
    def test_case_13_solvers_at_default_tolerances_fail(self, way: str) -> None:
        fails(13, getattr(solvers, way))

    def test_case_14_a_sign_after_each_step_fails(self) -> None:
        assert fails(14, solvers.step_by_step) == math.inf

    def test_case_15_explicit_steps_fail(self) -> None:
        assert fails(15, CASES[15].shipped(None)._replace(solve=solvers.explicit), spikes=1) > 1e4

    def test_case_16_delay_taken_off_at_the_latch_fails(self) -> None:
        assert fails(16, naive.delay_at_the_latch) == math.inf

    def test_case_21_coulombs_fail(self) -> None:
        fails(21, [solvers.phases_in_coulombs])
