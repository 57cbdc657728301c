"""Scenes of a few particles whose systems have the same fields, and kernels of the same types, as those of a scene."""

from typing import Any

from parsolid.materials.declaration import BandWidth, Direction, OfPlace, parameters_of
from parsolid.methods import method_class
from parsolid.scene import Scene
from parsolid.scene.method_settings import MethodSettings

Tables = dict[str, Any]


def small_scene(scene: Scene, method: MethodSettings) -> Tables:
    """A scene of a few particles whose kernels have the same types as those of one system."""
    d, full = scene.dimension, scene.resolved()
    bodies = []
    for index, body in enumerate(full["bodies"]):
        lower = [10.0 * index] + [0.0] * (d - 1)
        box = {"lower": lower, "upper": [lower[0] + 1.0] + [1.0] * (d - 1)}
        # directions and numbers by place are the same everywhere: those of the scene may be of its mesh, or none at the
        # small bodies
        material = dict(body["material"])
        for name, (_, note) in parameters_of(type(scene.bodies[index].material).declared).items():
            if isinstance(note, Direction) and material.get(name) is not None:
                material[name] = {"vector": [1.0] + [0.0] * (d - 1)}
            elif isinstance(note, OfPlace):
                material[name] = 1.0
            elif isinstance(note, BandWidth):
                material[name] = note.at_rest
        bodies.append({"shape": {"box": box}, "particles": [3] * d, "placement": "vertices", "material": material})
    kinds = {boundary["kind"] for boundary in full["boundaries"]}
    axis = "XY"[d > 1]
    boundaries = [
        {"plane": f"{axis} = 0", "kind": kind} for kind in sorted(kinds & {"fixed", "roller", "antisymmetric"})[:1]
    ]
    if "velocity" in kinds:
        boundaries.append({"plane": f"{axis} = 1", "kind": "velocity", "velocity": [0.0] * d})
    loads = {"acceleration": [0.0] * d} if full.get("loads") or "traction" in kinds else {}
    small = {"dimension": d, "end_time": 1.0, "method": full["method"], "bodies": bodies, "boundaries": boundaries}
    return method_class(method).small_scene(small | {"loads": loads, "title": "warming up"})
