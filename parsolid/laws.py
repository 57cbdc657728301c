"""Material laws of a scene's bodies."""

from importlib import import_module

# the module of each kind of material, loaded only when a scene has it; its `of_material` makes the law
_MODULES = {
    "mooney-rivlin": "parsolid.materials.mooney_rivlin",
    "neo-hookean": "parsolid.materials.mooney_rivlin",
    "elastic-plastic": "parsolid.materials.elastic_plastic",
}


def laws_of(scene) -> list:
    """One law for each body."""
    return [law_of(body.material) for body in scene.bodies]


def law_of(material):
    """The parameters, a NamedTuple, of a material as a scene states it."""
    return import_module(_MODULES[material.kind]).of_material(material)
