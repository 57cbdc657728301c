"""Names that go with plastic flow: fields that scenes may name, and what bodies without it lack."""

from typing import Any

import numpy as np

from parsolid.methods.failure_fields import kept_column
from parsolid.particles.container import Particles
from parsolid.scene.method_settings import named_observables

# what particles of elastic-plastic laws carry
PLASTIC_STATE = (
    kept_column("plastic_strain", 1, "1"),
    kept_column("internal_energy", 1, "J/m^3"),
    kept_column("temperature", 1, "K"),
)
BACK_STRESS, BACK_STRESS_ENERGY = "back_stress", "back_stress_energy"
# plastic logarithmic strain of volume, and that of the cap alone
VOLUME_FLOW = "volume_flow"
_OF_PLASTICITY = (
    *(field.name for field in PLASTIC_STATE),
    "maximum_temperature",
    "maximum_plastic_strain",
    "heat",
    "entropy",
)


def flowing(scene: Any) -> list[int]:
    """Numbers of the elastic-plastic bodies of a scene."""
    return [i for i, body in enumerate(scene.bodies) if body.material.kind == "elastic-plastic"]


def has_back_stress(law: Any) -> bool:
    """Whether a law has kinematic hardening."""
    return getattr(law, "kinematic_hardening", None) is not None


def flows_in_volume(law: Any) -> bool:
    """Whether flow changes the volume."""
    return getattr(type(getattr(law, "flow_stress", None)), "flows_in_volume", False)


def declare_flow_state(particles: Particles, laws: list[Any], components: int) -> None:
    """What particles carry where any law needs it; components: of back stresses."""
    if any(map(has_back_stress, laws)):
        particles.declare(kept_column(BACK_STRESS, components, "Pa"))
    if any(map(flows_in_volume, laws)):
        particles.declare(kept_column(VOLUME_FLOW, 2, "1"))


def flow_state(particles: Particles, law: Any) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Back stresses and plastic volumes of all particles as kernels take them, None where a law has none."""
    stored = particles.storage
    back_stress = stored(BACK_STRESS) if has_back_stress(law) else None
    return back_stress, stored(VOLUME_FLOW) if flows_in_volume(law) else None


def fields_of_no_body(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """What is to be shown of plastic flow where no body of a scene flows."""
    if flowing(scene):
        return []
    return [
        (place, "something that a body of this scene has", name)
        for place, name in named_observables(scene)
        if name in _OF_PLASTICITY
    ]


def temperatures_without_heat(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """Temperatures at the start of bodies whose laws know none, in methods where flow alone has heat."""
    flow, expected = flowing(scene), "no such key with this method but for an elastic-plastic material"
    stated = [(i, body.temperature) for i, body in enumerate(scene.bodies) if body.temperature is not None]
    return [(("bodies", i, "temperature"), expected, given.source) for i, given in stated if i not in flow]


def total_lagrangian_faults(material: Any, here: tuple[Any, ...]) -> list[tuple[tuple[Any, ...], str, object]]:
    """What of an elastic-plastic material at a place of the scene methods of a reference configuration do not know."""
    expected = "no such key: the method conducts no heat"
    faults: list[tuple[tuple[Any, ...], str, object]] = [
        ((*here, key), expected, getattr(material, key))
        for key in ("conductivity", "conductivity_tensor")
        if getattr(material, key) is not None
    ]
    if material.failure is not None and material.failure.after == "delete":
        expected = "'pressure': neighbours of a reference configuration stay neighbours"
        faults.append(((*here, "failure", "after"), expected, "delete"))
    return faults
