"""A balance is judged against the largest energy seen, and against rounding where there is none."""

import pytest

from parsolid.simulation.energy_balance import EnergyBalance

pytestmark = pytest.mark.serial


def row(balance: float, kinetic: float = 1.0, stored: float = 0.0, work: float = 0.0) -> dict[str, float]:
    return {"kinetic": kinetic, "stored": stored, "work_external": work, "balance": balance}


@pytest.mark.parametrize("energies", [{"kinetic": 10.0}, {"stored": 10.0}, {"work": -10.0}])
def test_a_fifth_of_the_largest_energy_is_too_much(energies):
    judge = EnergyBalance()
    judge.judge(row(0.0, **energies), 0.0)
    judge.judge(row(-1.99), 0.0)
    assert judge.broken is None and judge.largest == 10.0
    judge.judge(row(2.01), 0.0)
    assert judge.broken == 2.01


def test_what_is_not_a_number_is_broken():
    judge = EnergyBalance()
    judge.judge(row(float("nan")), 0.0)
    assert judge.broken is not None


def test_rounding_of_the_scale_is_allowed():
    judge = EnergyBalance()
    judge.judge(row(1e-6, kinetic=0.0), 1e7)
    assert judge.broken is None
    judge.judge(row(1e-4, kinetic=0.0), 1e7)
    assert judge.broken == 1e-4


def test_the_relative_balance_is_of_the_largest_energy_or_of_the_scale():
    judge = EnergyBalance()
    assert judge.relative(1.0, 0.0) is None and judge.relative(1.0, 4.0) == 0.25
    judge.judge(row(0.0, kinetic=10.0), 0.0)
    assert judge.relative(1.0, 4.0) == 0.1
