"""The library's steel with micro-inertia, with and without what can be left out."""

from pydantic import TypeAdapter

from parsolid.materials.registry import law_of
from parsolid.scene.materials import Material

LIBRARY = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}


def stated(changes):
    """The law of the library's table with changes."""
    return law_of(TypeAdapter(Material).validate_python(LIBRARY | changes))


# without gradients, which a material point has not
STEEL = stated(
    dict.fromkeys(("energetic_length", "hardening_length", "dissipative_length", "flux_relaxation_time"), 0.0)
)


def classical():
    """Without micro-inertia and relaxation."""
    return STEEL._replace(inertia_length=None, stress_relaxation_time=None)
