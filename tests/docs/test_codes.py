"""The page of codes has the tables of the code; no fault has another code."""

from pathlib import Path

import pytest

from parsolid.scene.codes import ENERGY_CHECK, FAULTS, NOTES, WARNINGS
from parsolid.scene.validation_errors import Fault
from parsolid.simulation import energy_check

pytestmark = pytest.mark.serial
PAGE = Path(__file__).parents[2] / "docs" / "warnings.md"
BEGIN, END = "<!-- codes -->\n", "<!-- end of codes -->"
TABLES = {
    "Errors in a scene": FAULTS,
    "Warnings": WARNINGS,
    "Notes": NOTES,
    "Energy check": ENERGY_CHECK,
}


def tables() -> str:
    """The tables of all codes in Markdown."""
    parts = []
    for title, codes in TABLES.items():
        rows = [f"| `{code}` | {one.says} | {one.remedy} |" for code, one in codes.items()]
        parts += [f"## {title}", "", "| code | what it says | what to do |", "|---|---|---|", *rows, ""]
    return "\n".join(parts)


def test_the_page_has_the_tables_of_the_code():
    assert PAGE.read_text(encoding="utf-8").split(BEGIN)[1].split(END)[0] == tables()


def test_the_energy_check_has_no_other_codes():
    names = ("ENERGY_UNACCOUNTED", "ENERGY_GIVEN", "LONG_STEP", "MOMENTUM_LOST", "ANGULAR_MOMENTUM_LOST")
    names += ("BEYOND_THE_METHOD", "NUMERICAL_DISSIPATION", "ARTIFICIAL_VISCOSITY")
    assert {getattr(energy_check, name) for name in names} == set(ENERGY_CHECK)


def test_a_fault_of_no_known_code_cannot_be_made():
    assert Fault("bound", "end_time", "a number > 0", "-1").code == "bound"
    with pytest.raises(ValueError, match="bounds"):
        Fault("bounds", "end_time", "a number > 0", "-1")


if __name__ == "__main__":
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(before + BEGIN + tables() + END + rest.split(END)[1], encoding="utf-8")
