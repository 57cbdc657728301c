"""Faults of a scene: the exception with all of them, the words of their messages, and renamed keys."""

import difflib
from collections.abc import Iterable

from parsolid.materials.declaration import Phrase
from parsolid.scene.codes import FAULTS

# old name -> new names; a message suggests those that are known in its place
RENAMED: dict[str, tuple[str, ...]] = {
    # keys
    "heated": ("thermal_reference",),
    "pair_correction": ("weights",),
    "cost": ("core_seconds",),
    "yardstick": ("other_code",),
    # kinds and values
    "micro_clamped": ("micro-hard",),
    "heat_flux": ("heat-flux",),
    "surface_pressure": ("pressure",),
    "nodes": ("vertices",),
    # columns of history.csv
    "stored": ("strain_energy", "internal_energy"),
    "dissipation_internal": ("material_dissipation",),
    "dissipation_numerical": ("numerical_dissipation",),
    "dissipation_fracture": ("fracture_dissipation",),
    "work_external": ("external_work",),
    "work_fixed_walls": ("fixed_wall_work",),
    "deleted_stored": ("deleted_internal_energy",),
    "leapfrog_oscillation": ("kinetic_offset",),
    "contact_oscillation": ("kinetic_offset",),
    "balance": ("energy_error",),
    # fields and quantities
    "deviator_norm": ("von_mises_stress",),
    "maximum_deviator_norm": ("maximum_von_mises_stress",),
    # measures of a study
    "internal_dissipation": ("material_dissipation",),
}


class Fault(str):
    """A fault, "key: expected ..., found ...", with its parts; code: one of `codes.FAULTS`."""

    code: str
    key: str
    expected: str
    found: str
    suggestion: str

    def __new__(cls, code: str, key: str, expected: str, found: str, suggestion: str = "") -> "Fault":
        if code not in FAULTS:
            raise ValueError(f"code: expected one of {', '.join(FAULTS)}, found {code!r}")
        result = super().__new__(cls, f"{key}: expected {expected}, found {found}{suggestion}")
        result.code, result.key, result.expected = code, key, expected
        result.found, result.suggestion = found, suggestion
        return result

    def __getnewargs__(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.code, self.key, self.expected, self.found, self.suggestion


class MeshFault(str):
    """A fault of a mesh, "expected ..., found ...", with its parts; key: of the table of the shape."""

    code: str
    expected: str
    found: str
    key: str

    def __new__(cls, code: str, expected: str, found: str, key: str = "file") -> "MeshFault":
        result = super().__new__(cls, f"expected {expected}, found {found}")
        result.code, result.expected, result.found, result.key = code, expected, found, key
        return result

    def __getnewargs__(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.code, self.expected, self.found, self.key

    def at(self, location: Iterable[object]) -> Fault:
        """The fault of the scene; location: of the table of the shape."""
        return Fault(self.code, key_path((*location, self.key)), self.expected, self.found)


class SceneError(Exception):
    """A scene cannot be run; faults: all reasons, those of the tables of a scene as `Fault`."""

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = list(faults)
        super().__init__(self.faults)

    def __str__(self) -> str:
        return "\n".join(self.faults)


NOTHING = Phrase("nothing")


def describe(value: object) -> str:
    """A value as a message shows it."""
    if isinstance(value, list | tuple):
        value = [one.model_dump(exclude_none=True) if hasattr(one, "model_dump") else one for one in value]
    elif hasattr(value, "model_dump"):
        value = value.model_dump(exclude_none=True)
    if isinstance(value, dict):
        return f"a table with {', '.join(map(repr, value))}" if value else "an empty table"
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    # begin and end of a path are more useful than its middle
    return text if len(text) <= 80 else f"{text[:37]}...{text[-40:]}"


def suggestion(word: object, known: Iterable[str]) -> str:
    """A suggestion for a misspelt or renamed word, in brackets; empty if no known word is near."""
    known = list(known)
    if new := [repr(name) for name in RENAMED.get(str(word), ()) if name in known]:
        return f" (now called {' or '.join(new)})"
    near = difflib.get_close_matches(str(word), known, n=1, cutoff=0.6)
    return f" (did you mean {near[0]!r}?)" if near else ""


def key_path(location: Iterable[object]) -> str:
    """The dotted path of a key, as for `--set`; "scene" for the empty location."""
    return ".".join(map(str, location)) or "scene"


def place_in_words(place: Iterable[float]) -> str:
    """Coordinates [m] as messages state them."""
    return ", ".join(f"{x:g}" for x in place)


def fault(location: Iterable[object], expected: str, found: object, code: str = "refused") -> Fault:
    """The fault of the key at a location."""
    return Fault(code, key_path(location), expected, describe(found))
