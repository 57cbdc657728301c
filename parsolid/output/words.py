"""How quantities and their units are called, the same on all pictures."""

import re

UNITS = {
    "displacement": "m",
    "position": "m",
    "velocity": "m/s",
    "pressure": "Pa",
    "von_mises_stress": "Pa",
    "nodal_von_mises_stress": "Pa",
    "nodal_stress": "Pa",
    "flow_stress": "Pa",
    "back_stress": "Pa",
    "stress": "Pa",
    "first_piola_kirchhoff_stress": "Pa",
    "volume": "m³",
    "temperature": "K",
    "maximum_temperature": "K",
    "density": "kg/m³",
    "internal_energy": "J/m³",
    "plastic_work": "J",
    "heat": "J",
    "lower_bounds": "m",
    "upper_bounds": "m",
    "twist": "rad",
    "linear_momentum": "kg m/s",
    "angular_momentum": "kg m²/s",
    "centre_of_mass": "m",
    "maximum_speed": "m/s",
    "plastic_strain_rate": "1/s",
    "entropy": "J/K",
    "failed_mass": "kg",
    "deleted_mass": "kg",
    "deleted_momentum": "kg m/s",
    "force": "N",
    "moment": "N m",
    "work": "J",
    "place": "m",
    "rotation": "rad",
}
# columns of the ledger, whose names leave out what they are of
_LEDGER = {
    "kinetic": "kinetic energy",
    "micro_kinetic": "micro-kinetic energy",
}
_PERSONS = {"mises": "Mises", "piola kirchhoff": "Piola-Kirchhoff"}


def unit_of(name: str) -> str:
    """Unit of a field, of one of its components, or of a quantity; empty when it has none or it is not known."""
    if name in UNITS:
        return UNITS[name]
    field, _, part = name.rpartition("_")
    return UNITS.get(field, "") if part and set(part) <= set("xyz") else ""


def words_of(name: str) -> str:
    """A field, a component of one, a term of the ledger or a probe's column (probe.field) in words."""
    probe, _, column = name.rpartition(".")
    field, _, part = column.rpartition("_")
    component = f" {part}" if field and part and set(part) <= set("xyz") else ""
    words = _LEDGER.get(column, (field if component else column).replace("_", " "))
    for lower, person in _PERSONS.items():
        words = words.replace(lower, person)
    # "mode_1" is said "mode 1"
    return f"{words}{component}" + (f", {re.sub('_+', ' ', probe)}" if probe else "")


def labelled(words: str, unit: str) -> str:
    """Words with their unit in brackets, where there is one."""
    return f"{words} [{unit}]" if unit else words
