"""Every fault and every finding of the energy check has a code of the tables."""

import pytest

from parsolid.scene.codes import ENERGY_CHECK
from parsolid.scene.validation_errors import Fault
from parsolid.simulation import energy_check

pytestmark = pytest.mark.serial


def test_the_energy_check_has_no_other_codes():
    names = ("ENERGY_UNACCOUNTED", "ENERGY_GIVEN", "LONG_STEP", "MOMENTUM_LOST", "ANGULAR_MOMENTUM_LOST")
    names += ("BEYOND_THE_METHOD", "NUMERICAL_DISSIPATION", "ARTIFICIAL_VISCOSITY", "NOT_SLOW")
    assert {getattr(energy_check, name) for name in names} == set(ENERGY_CHECK)


def test_a_fault_of_no_known_code_cannot_be_made():
    assert Fault("bound", "end_time", "a number > 0", "-1").code == "bound"
    with pytest.raises(ValueError, match="bounds"):
        Fault("bounds", "end_time", "a number > 0", "-1")
