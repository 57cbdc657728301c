"""A balance is judged against the largest energy seen, and against rounding where there is none."""

from types import SimpleNamespace

import pytest

from parsolid.simulation.energy_check import EnergyCheck, EnergyLimits

pytestmark = pytest.mark.serial
LIMITS = EnergyLimits(0.01, 0.2, 0.1)


def row(
    balance: float, kinetic: float = 1.0, strain_energy: float = 0.0, work: float = 0.0, lost: float = 0.0
) -> dict[str, float]:
    return {
        "kinetic": kinetic,
        "strain_energy": strain_energy,
        "external_work": work,
        "energy_error": balance,
        "numerical_dissipation": lost,
    }


@pytest.mark.parametrize("energies", [{"kinetic": 10.0}, {"strain_energy": 10.0}, {"work": -10.0}])
def test_a_fifth_of_the_largest_energy_is_too_much(energies):
    judge = EnergyCheck(LIMITS)
    judge.check(row(0.0, **energies), 0.0, initial=10.0)
    judge.check(row(-1.99), 0.0, initial=10.0)
    assert judge.violation is None and judge.largest == 10.0
    judge.check(row(2.01), 0.0, initial=10.0)
    assert judge.violation == 2.01


def test_a_load_that_rises_is_measured_by_what_it_is_about_to_bring():
    """A step's work may be off by itself and a half at a limit of 5 %, however little energy there is as yet."""
    judge = EnergyCheck(LIMITS._replace(balance_limit=0.05))
    judge.check(row(0.0, kinetic=0.0), 0.0)
    judge.check(row(1.5, kinetic=0.1, work=1.0), 0.0, work=1.0)
    assert judge.violation is None and judge.growth == 1.0 and judge.worst == 1.5
    judge.check(row(1.7, kinetic=0.1, work=1.0), 0.0)
    assert judge.violation == 1.7


def test_between_rows_far_apart_the_last_step_tells_and_else_the_mean():
    judge = EnergyCheck(LIMITS)
    judge.check(row(0.0, kinetic=0.0), 0.0)
    judge.check(row(0.0, kinetic=3.0, work=3.0), 0.0, steps=100, work=2.0)
    assert judge.growth == 2.0
    judge.check(row(0.0, kinetic=1003.0, work=3.0), 0.0, steps=100)
    assert judge.growth == 10.0


def test_a_balance_lost_in_a_loaded_state_is_broken_at_once():
    """Loaded evenly in a thousand steps, a body may be off by 3 % more of its energy than the limit says."""
    judge = EnergyCheck(LIMITS)
    for energy in range(0, 1001, 100):
        judge.check(row(0.0, kinetic=0.0, strain_energy=energy, work=energy), 0.0, steps=100, work=1.0)
    judge.check(row(206.0, strain_energy=1000.0, work=1000.0), 0.0)
    assert judge.violation is None
    judge.check(row(207.0, strain_energy=1000.0, work=1000.0), 0.0)
    assert judge.violation == 207.0


@pytest.mark.parametrize("factor", [1.5, 3.0, 100.0])
def test_energy_that_grows_from_nothing_is_broken_however_fast(factor):
    """What no load has brought does not widen the limit by which it is judged."""
    judge, energy = EnergyCheck(LIMITS._replace(balance_limit=0.05)), 1.0
    judge.check(row(0.0, kinetic=energy), 0.0, initial=1.0)
    while judge.violation is None and energy < 1e3:
        energy *= factor
        judge.check(row(energy - 1.0, kinetic=energy), 0.0, initial=1.0)
    assert judge.violation == energy - 1.0 == factor - 1.0 and judge.growth == 0.0


@pytest.mark.parametrize("jump", [True, False], ids=["jump of the loads", "energy of the start"])
def test_what_has_not_gone_in_by_steps_widens_nothing(jump):
    judge = EnergyCheck(LIMITS)
    if jump:
        judge.check(row(0.0, kinetic=0.0), 0.0)
        judge.check(row(0.0, kinetic=10.0, work=10.0), 0.0, steps=None, work=10.0)
    else:
        judge.check(row(0.0, kinetic=10.0), 0.0, initial=10.0)
    assert judge.growth == 0.0
    judge.check(row(2.01, kinetic=10.0, work=10.0 * jump), 0.0, initial=10.0 * (not jump))
    assert judge.violation == 2.01


@pytest.mark.parametrize("balance, energy", [(1.0, float("inf")), (1.0, float("nan")), (float("nan"), 1.0)])
def test_what_is_no_number_or_has_no_bounds_is_broken(balance, energy):
    judge = EnergyCheck(LIMITS)
    judge.check(row(balance, kinetic=energy), 0.0)
    assert judge.violation is not None


def test_rounding_of_the_scale_is_allowed():
    judge = EnergyCheck(LIMITS)
    judge.check(row(1e-6, kinetic=0.0), 1e7)
    assert judge.violation is None
    judge.check(row(1e-4, kinetic=0.0), 1e7)
    assert judge.violation == 1e-4


def test_the_relative_balance_is_of_the_largest_energy_or_of_the_scale():
    judge = EnergyCheck(LIMITS)
    assert judge.relative(1.0, 0.0) is None and judge.relative(1.0, 4.0) == 0.25
    judge.check(row(0.0, kinetic=10.0), 0.0)
    assert judge.relative(1.0, 4.0) == 0.1
    # as large as round-off is no energy
    assert judge.relative(1.0, 1e13) == 1e-13


def test_the_tightest_of_several_methods_counts():
    a, b = SimpleNamespace(**LIMITS._asdict()), SimpleNamespace(**EnergyLimits(0.02, 0.1, 0.3)._asdict())
    assert EnergyLimits.of([a, b]) == EnergyLimits(0.01, 0.1, 0.1)


@pytest.mark.parametrize(
    "rows, word, code",
    [
        ([row(0.0, kinetic=0.0)], "ok", None),
        ([row(0.05), row(0.005)], "unbalanced", "energy-unaccounted"),
        ([row(4.5e-5, kinetic=0.3, lost=0.68)], "dissipative", "numerical-dissipation"),
        ([row(0.0, lost=0.15, work=1.0)], "ok", None),
        ([row(0.0, lost=0.15, work=-0.5)], "dissipative", "numerical-dissipation"),
        ([row(0.0, lost=-0.15)], "unbalanced", "energy-given"),
        ([row(0.0, lost=-0.02), row(0.0, lost=0.03)], "unbalanced", "energy-given"),
        ([row(0.0, lost=-0.009), row(0.0, lost=0.04)], "ok", None),
        ([row(0.0, lost=-1e-6)], "ok", None),
        ([row(0.009, lost=0.09)], "ok", None),
        ([row(float("nan"))], "unbalanced", "energy-unaccounted"),
    ],
)
def test_a_word_by_the_largest_error_and_by_the_energy_that_went_in(rows, word, code):
    judge = EnergyCheck(LIMITS)
    for one in [row(0.0), *rows]:
        judge.check(one, 0.0, initial=1.0)
    said = judge.verdict(0.0)
    assert (said["energy_check"], said["energy_check_code"]) == (word, code)
    assert said["numerical_dissipation"] == rows[-1]["numerical_dissipation"]


def test_what_the_scheme_has_given_is_kept():
    judge = EnergyCheck(LIMITS)
    for lost in (0.0, 0.3, -0.05, 0.4):
        judge.check(row(0.0, kinetic=2.0, lost=lost), 0.0)
    assert judge.gained == 0.05 and judge.verdict(0.0)["spurious_energy_gain"] == 0.025


@pytest.mark.parametrize("name", ["fracture_dissipation", "friction_dissipation"])
def test_what_a_dissipation_gives_back_is_a_gain(name):
    judge = EnergyCheck(LIMITS)
    for energy in (1.0, 1.4, 1.36, 1.5):
        judge.check(row(0.0, kinetic=2.0) | {name: energy}, 0.0)
    assert judge.gained == pytest.approx(0.04)
    again = EnergyCheck(LIMITS)
    again.set_state(judge.state(), 0.0)
    again.check(row(0.0, kinetic=2.0) | {name: 1.45}, 0.0)
    said = again.verdict(0.0)
    assert again.gained == pytest.approx(0.05) and said["energy_check_code"] == "energy-given"


@pytest.mark.parametrize(
    "lost, viscous, word, code",
    [
        (0.01, 0.08, "ok", None),
        (0.01, 0.86, "dissipative", "artificial-viscosity"),
        (0.06, 0.05, "dissipative", "artificial-viscosity"),
        (0.3, 0.86, "dissipative", "numerical-dissipation"),
        (0.3, 0.0, "dissipative", "numerical-dissipation"),
    ],
)
def test_what_artificial_viscosity_took_counts_as_lost(lost, viscous, word, code):
    judge = EnergyCheck(LIMITS, ("viscous_work", "viscous_heat"))
    for part in (0.0, 0.5):
        one = row(0.0, lost=2.0 * part * lost)
        judge.check(one | {"viscous_work": part * viscous, "viscous_heat": part * viscous}, 0.0, initial=1.0)
    said = judge.verdict(0.0)
    assert (said["energy_check"], said["energy_check_code"]) == (word, code)
    assert said["artificial_viscosity_share"] == pytest.approx(viscous)


@pytest.mark.parametrize(
    "momenta, word, code",
    [
        ((0.009, 0.009), "ok", None),
        ((0.011, 0.0), "unbalanced", "momentum-lost"),
        ((0.0, 0.011), "unbalanced", "angular-momentum-lost"),
        ((0.0, float("nan")), "unbalanced", "angular-momentum-lost"),
    ],
)
def test_lost_momentum_is_unbalanced(momenta, word, code):
    judge = EnergyCheck(LIMITS)
    judge.check(row(0.0), 0.0, initial=1.0)
    said = judge.verdict(0.0, momenta=momenta)
    assert (said["energy_check"], said["energy_check_code"]) == (word, code)
    assert said["momentum_lost_share"] == momenta[0]


def test_all_that_speaks_against_a_run_is_listed_and_the_gravest_counts():
    judge = EnergyCheck(LIMITS)
    judge.check(row(0.05, lost=0.5), 0.0, initial=1.0)
    said = judge.verdict(0.0, ["bonds are long"], (0.0, 0.5))
    assert [one["code"] for one in said["energy_check_findings"]] == [
        "energy-unaccounted",
        "angular-momentum-lost",
        "beyond-the-method",
        "numerical-dissipation",
    ]
    assert (said["energy_check"], said["energy_check_code"]) == ("unbalanced", "energy-unaccounted")
    assert judge.verdict(0.0)["energy_check_code"] == "energy-unaccounted"


@pytest.mark.parametrize("names", [("kinetic_offset",), ("kinetic_offset", "kinetic_offset_mpm")])
@pytest.mark.parametrize("offset, word", [(0.49, "ok"), (-0.49, "ok"), (0.51, "unbalanced"), (-0.51, "unbalanced")])
def test_a_kinetic_offset_above_a_twentieth_of_the_largest_energy_is_too_long_a_step(names, offset, word):
    """A closed balance does not show it, and an offset that has passed counts as well."""
    judge = EnergyCheck(LIMITS)
    still = dict.fromkeys(names, 0.0)
    for last in (0.0, offset, 0.0):
        judge.check(row(0.0, kinetic=10.0) | still | {names[-1]: last}, 0.0, initial=10.0)
    said = judge.verdict(0.0)
    assert said["energy_check"] == word and said["kinetic_offset_largest"] == pytest.approx(abs(offset) / 10.0)
    assert said["energy_error_share_largest"] == 0.0 and judge.violation is None
