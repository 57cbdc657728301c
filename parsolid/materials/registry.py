"""Material laws of a scene's bodies."""

from importlib import import_module

# the module of each kind of material, loaded only when a scene has it; its `of_material` makes the law
_MODULES = {
    "mooney-rivlin": "parsolid.materials.hyperelastic.mooney_rivlin",
    "neo-hookean": "parsolid.materials.hyperelastic.mooney_rivlin",
    "elastic-plastic": "parsolid.materials.plastic.elastic_plastic",
    "prony": "parsolid.materials.viscoelastic.prony",
    "linear-elastic": "parsolid.materials.viscoelastic.prony",
    "bond-based": "parsolid.materials.damage.bond_based",
}


# laws of the small strains that a body can have, made for the state of strain
_BY_STATE = ("prony", "linear-elastic")


def laws_of(scene) -> list:
    """One law for each body."""
    state = scene.method.state(scene.dimension)
    return [law_of(body.material, state) for body in scene.bodies]


def law_of(material, state: str = "space"):
    """The parameters, a NamedTuple, of a material as a scene states it; state: see `MethodSettings.state`."""
    make = import_module(_MODULES[material.kind]).of_material
    return make(material, state) if material.kind in _BY_STATE else make(material)
