"""The law of one material on numpy arrays."""

import os
from typing import Any

import numpy as np
from pydantic import ValidationError

from parsolid.materials.hyperelastic import acoustics, evaluation
from parsolid.materials.registry import law_at_origin
from parsolid.point.driver import integrate, point_law, tabulate
from parsolid.point.schema import MaterialPoint
from parsolid.scene.base_model import SceneModel, faults_of_errors
from parsolid.scene.materials import HyperelasticSolid, Material, ValueFault
from parsolid.scene.validation_errors import SceneError


class _Stated(SceneModel):
    material: Material


def material(kind: str = "", /, *, trust_code: bool = False, **keys: Any) -> "MaterialLaw":
    """A material with the keys of the table `material` of a scene: `material("neo-hookean", density=1100.0, ...)`.

    trust_code: execute the file of a law (`law="my.py:Mine"`, without a kind). Raises SceneError with all faults.
    """
    table = ({"kind": kind} if kind else {}) | keys
    context = {"dimension": 3, "folder": os.getcwd(), "trust_code": trust_code}
    try:
        stated = _Stated.model_validate({"material": table}, context=context).material
    except ValidationError as error:
        raise SceneError(dict.fromkeys(faults_of_errors(error))) from None
    try:
        return MaterialLaw(stated, trust_code)
    except ValueFault as fault:
        raise SceneError([f"material.{fault}"]) from None


class MaterialLaw:
    """A law, at rest before time 0; F (..., 3, 3): deformation gradients."""

    def __init__(self, stated: Any, trust_code: bool = False) -> None:
        """stated: the validated table of a scene."""
        self.stated, self.law, self._trust_code = stated, law_at_origin(stated), trust_code

    def __repr__(self) -> str:
        return f"<material {self.stated.kind or type(self.law).__name__}: {self.law}>"

    def energy(self, F: Any) -> np.ndarray:
        """Stored energy density after relaxation, W_infinity [J/m^3] (...)."""
        return evaluation.energies(self._hyperelastic("energy"), _checked(F))

    def stress(self, F: Any) -> np.ndarray:
        """First Piola-Kirchhoff stress [Pa] (..., 3, 3) after relaxation."""
        return evaluation.stresses(self._hyperelastic("stress"), _checked(F))

    def cauchy_stress(self, F: Any) -> np.ndarray:
        """Cauchy stress P F^T / J [Pa] (..., 3, 3) after relaxation."""
        F = _checked(F)
        return self.stress(F) @ np.swapaxes(F, -1, -2) / np.linalg.det(F)[..., None, None]

    def wave_speeds(self, F: Any, direction: Any) -> np.ndarray:
        """Speeds [m/s] (..., 3) of waves along a direction (3,) in the reference configuration, the slowest first.

        nan where the material is not stable.
        """
        law, N = self._hyperelastic("wave_speeds"), np.asarray(direction, float)
        moduli = acoustics.wave_moduli(law, _checked(F), N / np.linalg.norm(N))
        with np.errstate(invalid="ignore"):
            return np.sqrt(moduli / law.density)

    def integrate(self, path: dict[str, Any], end_time: float, steps: int, **conditions: Any) -> dict[str, np.ndarray]:
        """Integrate the law along a path of F from rest, like the command `point`; column of point.csv -> values (n,).

        path: its table (`{"kind": "simple-shear", ...}`, docs/point.md); end_time [s]; conditions: further keys of a
        point's file, such as `temperature`. For all laws. Raises SceneError for a faulty path, PathLost if it cannot be
        followed.
        """
        table = {"end_time": end_time, "steps": steps, "path": path, **conditions}
        data = table | {"material": self.stated.model_dump(exclude_none=True)}
        context = {"dimension": 3, "folder": os.getcwd(), "trust_code": self._trust_code}
        try:
            point = MaterialPoint.model_validate(data, context=context)
        except ValidationError as error:
            raise SceneError(dict.fromkeys(faults_of_errors(error))) from None
        law = point_law(law_at_origin(point.material), **point.conditions)
        record = integrate(law, point.path, point.end_time, point.longest_step)
        return tabulate(law, record, np.array(point.output.directions))

    def _hyperelastic(self, what: str) -> Any:
        if not isinstance(self.stated, HyperelasticSolid):
            found = f"{self.stated.kind!r}, whose stress has a history: use integrate"
            raise TypeError(f"{what}: expected a hyperelastic law, found {found}")
        return self.law


def _checked(F: Any) -> np.ndarray:
    """F as an array of tensors."""
    F = np.asarray(F, float)
    if F.shape[-2:] != (3, 3):
        raise ValueError(f"F: expected an array (..., 3, 3), found {F.shape}")
    return F
