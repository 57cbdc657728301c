"""State and fields of plastic flow, and faults of scenes that name them without a body that flows."""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.materials.plastic.elastic_plastic import full_tensor
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
# of kinematic hardening and of flow in volume, which scenes may name
FLOW_FIELDS = {BACK_STRESS: "tensor", VOLUME_FLOW: "scalar"}
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


def shown_flow(
    particles: Particles, name: str, first: int, last: int, present: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """One of `FLOW_FIELDS` of particles first .. last - 1: back stress (n, 3, 3) [Pa], plastic logarithmic strain of
    volume (n,); 0 of laws without. present: turns back stresses (n, 3, 3) of the method's axes into present ones."""
    if name not in particles:
        return np.zeros((last - first, 3, 3) if name == BACK_STRESS else last - first)
    rows = particles.owned_rows(name)[first:last]
    if name == VOLUME_FLOW:
        return rows[:, 0].copy()
    # xz and yz are none in the plane
    components = np.zeros((6, len(rows)))
    components[: rows.shape[1]] = rows.T
    return present(full_tensor(components).transpose(2, 0, 1))


def flow_fields_of_no_body(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """What is to be shown of kinematic hardening and of flow in volume where no body of a scene has it."""
    parts = [scene.bodies[i].material.parts for i in flowing(scene)]
    known = {
        BACK_STRESS: any(one["kinematic_hardening"] is not None for one in parts),
        VOLUME_FLOW: any(getattr(one["flow_stress"].declared, "flows_in_volume", False) for one in parts),
    }
    return [
        (place, "something that a body of this scene has", name)
        for place, name in named_observables(scene)
        if not known.get(name, True)
    ]


def fields_of_no_body(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """What is to be shown of plastic flow where no body of a scene flows."""
    wanted, lacking = "something that a body of this scene has", () if flowing(scene) else _OF_PLASTICITY
    faults = [(place, wanted, name) for place, name in named_observables(scene) if name in lacking]
    return flow_fields_of_no_body(scene) + faults


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
