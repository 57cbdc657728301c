"""Scenes whose bodies are dealt out to several systems by hand, which no file can say yet."""

from parsolid.scene import Scene, parse_scene
from parsolid.scene.systems import SystemOfScene

SOFT = {"kind": "neo-hookean", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.4}
STIFF = SOFT | {"density": 1500.0, "youngs_modulus": 60e6}
# with its kernel stated particles have the volumes of other methods
SPH = {"kind": "tlsph", "kernel": "wendland-c2"}
BONDS = {"kind": "peridynamics", "horizon_ratio": 2.0, "solution": {"kind": "explicit"}}


def plate(name: str, lower: float, material=SOFT, **more) -> dict:
    """A square of 1 m from X = lower."""
    box = {"lower": [lower, 0.0], "upper": [lower + 1.0, 1.0]}
    velocity = [f"20*(X - {lower})", "-15*Y*Y"]
    return {"name": name, "shape": {"box": box}, "particles": [8, 8], "velocity": velocity, "material": material} | more


def raw(*bodies: dict, method=SPH, **rest) -> dict:
    """Raw tables of a scene of these bodies, held on Y = 0."""
    boundaries = [{"plane": "Y = 0", "kind": "roller"}]
    return {"dimension": 2, "end_time": 4e-3, "method": method, "bodies": list(bodies), "boundaries": boundaries} | rest


def split(scene: Scene, *systems: SystemOfScene) -> Scene:
    """The scene with its bodies in these systems."""

    class Split(Scene):
        @property
        def systems(self) -> tuple[SystemOfScene, ...]:
            return systems

    return Split.model_construct(**dict(scene))


def two_systems(data: dict, second: dict | None = None) -> Scene:
    """A scene of two bodies with a system for each; second: the raw settings of another method for the second."""
    scene = parse_scene(data)
    settings = scene.method if second is None else parse_scene(data | {"method": second}).method
    return split(scene, SystemOfScene(scene.method, (0,)), SystemOfScene(settings, (1,)))
