"""Parameters of a hyperelastic law from measured stretches and nominal stresses of sheets that keep their volume, and
from torques of twisted cylinders."""

from dataclasses import dataclass
from typing import Any, Literal, get_origin

import numpy as np

from parsolid.materials import registry
from parsolid.materials.declaration import Direction, Parameter, parameters_of
from parsolid.materials.hyperelastic.at_particles import members
from parsolid.materials.hyperelastic.functions import stress

# parameters that tests at constant volume do not determine, and those that state xi of the Mooney-Rivlin law otherwise
_UNSEEN = ("density", "bulk_modulus", "lambda_hat", "youngs_modulus", "poissons_ratio")
# principal stretches of each kind of test, and the free axis, by which the pressure is known
_KINDS = {
    "uniaxial": lambda a: (a, a**-0.5, a**-0.5),
    "equibiaxial": lambda a: (a, a, a**-2.0),
    "pure-shear": lambda a: (a, 1.0, 1.0 / a),
}
# of a cylinder of fixed length: the shear at its surface in place of the stretch, the torque over its radius cubed
TORSION = "torsion"
KINDS = (*_KINDS, TORSION)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
# starts of the search, and the range of pure numbers that they cover
_STARTS, _NUMBERS = 24, (2.0, 30.0)
# standard deviations in half a 95 % interval
_CONFIDENCE = 1.96
# logarithm of the most that free stretches differ from their mean
_MOST_UNEQUAL = 1.5
# residual of parameters that the law refuses, and the cost from which no start has led to others
_REFUSED, _LOST = 1e3, 1e2


@dataclass(frozen=True)
class Measured:
    """One test: its kind, stretches (n,) and nominal stresses (n,) [Pa]; of torsion see `TORSION`."""

    kind: str
    stretch: np.ndarray
    stress: np.ndarray

    @property
    def at_rest(self) -> float:
        """The stretch of no deformation."""
        return 0.0 if self.kind == TORSION else 1.0


@dataclass(frozen=True)
class Fit:
    """Names and values of parameters, half the width of their 95 % intervals (inf where the data do not tell), and the
    curve (n,) [Pa] at the stretches of each test; error: root mean square of the difference over the largest stress."""

    names: tuple[str, ...]
    values: np.ndarray
    spread: np.ndarray
    curves: list[np.ndarray]
    error: float


def nominal_stress(law: Any, kind: str, stretch: np.ndarray) -> np.ndarray:
    """Nominal stress (n,) [Pa] along the first axis at constant volume, without stress on the free face, in uniaxial
    tests on both; of torsion see `TORSION`."""
    if kind == TORSION:
        return np.array([_torque(law, float(shear)) for shear in stretch])
    result = np.empty(len(stretch))
    for n, a in enumerate(map(float, stretch)):
        l1, l2, l3 = _KINDS[kind](a)
        if kind == "uniaxial" and members(law):
            l2, l3 = _free_stretches(law, l1)
        P = _nominal(law, l1, l2, l3)
        result[n] = P[0] - P[8] * l3 / l1
    return result


@dataclass(frozen=True)
class Relaxed:
    """Stresses of sheets of a kind that are held: times since the stretch [s], stretches and nominal stresses [Pa]
    (n,)."""

    kind: str
    time: np.ndarray
    stretch: np.ndarray
    stress: np.ndarray


@dataclass(frozen=True)
class FittedBranches:
    """Moduli [Pa] of Maxwell branches and half the width of their 95 % intervals, relaxation times [s], and the root
    mean square of the difference over the largest stress."""

    moduli: np.ndarray
    spread: np.ndarray
    times: np.ndarray
    error: float


def fit_branches(law: Any, tests: list[Relaxed]) -> FittedBranches:
    """Branches with a relaxation time a decade of the times, from what stresses lie above those of the law: sums of
    mu exp(-t/tau) (l1 - l3^2/l1) of a jump to a stretch, l3 that of the free face, by least squares in which no modulus
    is negative. Raises ValueError where no stress lies above those of the law."""
    from scipy.optimize import nnls

    time = np.concatenate([one.time for one in tests])
    stress = np.concatenate([one.stress for one in tests])
    largest = np.abs(stress).max()
    slow = np.concatenate([nominal_stress(law, one.kind, one.stretch) for one in tests])
    stretches = [_KINDS[one.kind](float(a)) for one in tests for a in one.stretch]
    held = np.array([l1 - l3 * l3 / l1 for l1, _, l3 in stretches])
    decades = round(float(np.log10(time.max() / time.min())))
    times = np.geomspace(time.min(), time.max(), decades + 1)
    columns = held[:, None] * np.exp(-time[:, None] / times)
    moduli = nnls(columns, (stress - slow) / largest)[0] * largest
    kept = moduli > 1e-6 * moduli.max(initial=0.0)
    if not kept.any():
        raise ValueError("stresses of held sheets above those of slow tests")
    moduli, times, columns = moduli[kept], times[kept], columns[:, kept]
    difference = columns @ moduli + slow - stress
    variance = np.sum(difference**2) / max(len(stress) - len(moduli), 1)
    spread = _CONFIDENCE * np.sqrt(variance * np.diag(np.linalg.pinv(columns.T @ columns)))
    return FittedBranches(moduli, spread, times, float(np.sqrt(np.mean(difference**2)) / largest))


def _nominal(law: Any, l1: float, l2: float, l3: float) -> Any:
    F, H = (l1, 0.0, 0.0, 0.0, l2, 0.0, 0.0, 0.0, l3), (l2 * l3, 0.0, 0.0, 0.0, l1 * l3, 0.0, 0.0, 0.0, l1 * l2)
    return stress(law, F, H, 1.0)


def _torque(law: Any, shear: float) -> float:
    """2 pi int_0^1 s^2 tau(s shear) ds [Pa], tau the stress in simple shear."""
    places = 0.5 * (1.0 + _NODES)
    stresses = []
    for g in map(float, shear * places):
        F, H = (1.0, g, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, -g, 1.0, 0.0, 0.0, 0.0, 1.0)
        stresses.append(stress(law, F, H, 1.0)[1])
    # of the part of P beside the pressure, which is along H
    return float(np.pi * np.sum(_WEIGHTS * places**2 * stresses))


def _free_stretches(law: Any, l1: float) -> tuple[float, float]:
    """The other stretches of a uniaxial test, which differ where fibres lie in the sheet."""
    from scipy.optimize import brentq

    def unequal(e: float) -> float:
        l2, l3 = np.exp(e) * l1**-0.5, np.exp(-e) * l1**-0.5
        P = _nominal(law, l1, float(l2), float(l3))
        return float(P[4] * l2 - P[8] * l3)

    e = float(brentq(unequal, -_MOST_UNEQUAL, _MOST_UNEQUAL, xtol=1e-12))
    return float(np.exp(e) * l1**-0.5), float(np.exp(-e) * l1**-0.5)


def fitted_parameters(kind: str) -> dict[str, Any]:
    """Name -> `Parameter` of those of a hyperelastic kind that such tests tell."""
    # not one of several words (the volumetric part), nor what has one value (zeta of neo-Hookean solids)
    return {
        name: note
        for name, (annotation, note) in parameters_of(registry.declared("hyperelastic", kind)).items()
        if isinstance(note, Parameter) and get_origin(annotation) is not Literal and name not in _UNSEEN
    }


def has_fibres(kind: str) -> bool:
    """Whether a kind has a direction, the angle of which tests do not tell."""
    return any(
        isinstance(note, Direction) for _, note in parameters_of(registry.declared("hyperelastic", kind)).values()
    )


@np.errstate(over="ignore", invalid="ignore")
def fit(kind: str, tests: list[Measured], fixed: dict[str, float], angle: float = 0.0) -> Fit:
    """The least squares of all tests, each over its largest stress; fixed: parameters that stay; angle [degrees]: of
    fibres from the first axis, see `law_with`. Raises ValueError where nothing is left to fit, or no start leads
    anywhere, and for torsion of a law with fibres."""
    from scipy.optimize import least_squares

    if has_fibres(kind) and any(one.kind == TORSION for one in tests):
        raise ValueError("tests of sheets of a law with fibres, no torsion")

    parameters = {name: one for name, one in fitted_parameters(kind).items() if name not in fixed}
    if not parameters:
        raise ValueError("a parameter that is not fixed")
    names, modulus = tuple(parameters), max(_modulus_of(one) for one in tests)
    low = np.array([_bound(one.above, one.at_least, -np.inf) for one in parameters.values()])
    high = np.array([_bound(one.below, one.at_most, np.inf) for one in parameters.values()])
    units = np.array([modulus if one.unit == "Pa" else 1.0 for one in parameters.values()])
    largest = [np.abs(one.stress).max() * np.sqrt(len(one.stress)) for one in tests]

    def residual(x: np.ndarray) -> np.ndarray:
        law = law_with(kind, dict(zip(names, x * units)) | fixed, angle)
        if law is None:
            return np.full(sum(len(one.stress) for one in tests), _REFUSED)
        parts = [
            (nominal_stress(law, one.kind, one.stretch) - one.stress) / scale for one, scale in zip(tests, largest)
        ]
        return np.nan_to_num(np.concatenate(parts), nan=_REFUSED, posinf=_REFUSED, neginf=-_REFUSED)

    random, best = np.random.default_rng(0), None
    for start in range(_STARTS):
        x = np.where(units == modulus, 0.5, np.geomspace(*_NUMBERS, _STARTS)[start])
        x = x * 10.0 ** (random.normal(size=len(x)) * (start > 0)) * np.where(random.random(len(x)) < 0.2, -1.0, 1.0)
        x = np.clip(x, low / units + 1e-6, high / units - 1e-6)
        try:
            found = least_squares(residual, x, bounds=(low / units, high / units), x_scale=np.maximum(np.abs(x), 1e-3))
        except ValueError:
            continue
        if np.isfinite(found.cost) and (best is None or found.cost < best.cost):
            best = found
    if best is None or best.cost > _LOST:
        raise ValueError("a start that leads to parameters")
    law = law_with(kind, dict(zip(names, best.x * units)) | fixed, angle)
    points = sum(len(one.stress) for one in tests)
    freedom = max(points - len(names), 1)
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * 2.0 * best.cost / freedom
    spread = _CONFIDENCE * np.sqrt(np.diag(covariance)) * units
    curves = [nominal_stress(law, one.kind, one.stretch) for one in tests]
    return Fit(names, best.x * units, spread, curves, float(np.sqrt(2.0 * best.cost / len(tests))))


def directions_at(kind: str, angle: float) -> dict[str, Any]:
    """Directions of fibres in the sheet at an angle [degrees] from the first axis, as a scene states them: one family
    along an axis, else two, on both sides, where the kind has two."""
    stated, x, y = {}, float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
    for name, (_, note) in parameters_of(registry.declared("hyperelastic", kind)).items():
        if isinstance(note, Direction) and (note.needed or angle % 90.0 != 0.0):
            stated[name] = {"vector": [x, y if note.needed else -y, 0.0]}
    return stated


def law_with(kind: str, values: dict[str, float], angle: float = 0.0) -> Any:
    """The law of a kind with parameters and fibres at an angle, see `directions_at`; the bulk modulus is of no matter
    here. None where it refuses them."""
    import parsolid.scene.materials  # noqa: F401 (what hyperelastic tables have in common)
    from parsolid.scene.declared import model_of
    from parsolid.scene.validation_errors import SceneError

    declared = registry.declared("hyperelastic", kind)
    others = {"density": 1.0, "bulk_modulus": 1e9, "lambda_hat": 1e9}
    known = parameters_of(declared)
    stated: dict[str, Any] = {name: value for name, value in (others | values).items() if name in known}
    stated |= {"kind": kind} | directions_at(kind, angle)
    try:
        model: Any = model_of(declared).model_validate(stated, context={"dimension": 3})
        return model.law_at((0.0, 0.0, 0.0))
    except (SceneError, ValueError):
        return None


def _bound(excluded: float | None, included: float | None, otherwise: float) -> float:
    found = included if excluded is None else excluded
    return otherwise if found is None else float(found)


def _modulus_of(test: Measured) -> float:
    """A modulus [Pa] of the first point of a test that is stretched or compressed."""
    first = int(np.argmax(test.stretch != test.at_rest))
    return float(abs(test.stress[first] / (test.stretch[first] - test.at_rest)) / 3.0) or 1.0
