"""What is shown and told of material points besides their fields."""

from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.materials.plastic.plastic_evaluation import melting_temperature
from parsolid.methods import failed_matter
from parsolid.methods.mpm.points import MaterialPoints

# D in cells^2 by a particle's place in its cell, of which no spline but the hat function's depends on it
_SPREADS = {
    "quadratic-spline": lambda place: np.full_like(place, 0.25),
    "cubic-spline": lambda place: np.full_like(place, 1.0 / 3.0),
    "linear": lambda place: place * (1.0 - place),
}


def shown(points: MaterialPoints, name: str, first: int, last: int) -> np.ndarray | None:
    """See `protocol.ParticleSystem.shown`."""
    here = slice(first, last)
    if name == "deformation_gradient":
        return points.deformation_gradients(first, last)
    if name == "velocity_gradient":
        return points["velocity_gradient"][here].reshape(-1, 3, 4)[:, :, :3].copy()
    if name == "own_angular_momentum":
        return _own_angular_momentum(points, here)
    if name not in ("density", "stress"):
        return None
    mass, grid_volume = points["mass"][here], points.motion[here, 7]
    if "deleted_mass" in points:
        # what was deleted has no stress and keeps its density
        gone = points["deleted_mass"][here]
        laws = np.array([law.density for law in points.laws])[points.law_of_body[points["body"][here]]]
        mass, grid_volume = mass + gone, grid_volume + gone / laws
    volumes = grid_volume * points.jacobian(first, last)
    if name == "density":
        return np.asarray(mass / volumes)
    xx, yy, zz, _, yz, xz, xy, _ = points["stress_and_volume"][here].T
    stress = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    return np.asarray(stress / volumes[:, None, None])


def _own_angular_momentum(points: MaterialPoints, here: slice) -> np.ndarray | None:
    """What slopes C carry [kg m^2/s], m eps : C D, (n,) or (n, 3); None where there are no slopes.

    D_j = sum_i w_i (x_i - x_p)_j^2 of the nodes of a spline, as in `shape_functions.put_moments`; GIMP functions, of
    which it follows the particle's domain, are left out.
    """
    settings = points.settings
    if "velocity_slope" not in points or settings.basis not in _SPREADS or points.axisymmetric:
        return None
    places = (points["position"][here] - points.origin[: points.dimension]) / settings.cell
    spread = _SPREADS[settings.basis](places % 1.0) * settings.cell**2 * points["mass"][here][:, None]
    slope = points["velocity_slope"][here].reshape(-1, 3, 4)
    # of (C D)_ij = C_ij D_j
    pairs = ((2, 1), (0, 2), (1, 0)) if points.dimension == 3 else ((1, 0),)
    turning = [slope[:, i, j] * spread[:, j] - slope[:, j, i] * spread[:, i] for i, j in pairs]
    return np.stack(turning, axis=1) if points.dimension == 3 else turning[0]


def measure(points: MaterialPoints, name: str, plastic_work: float) -> tuple[str, np.ndarray]:
    """See `protocol.ParticleSystem.measure`."""
    if name.startswith("maximum_"):
        field = name.removeprefix("maximum_")
        values = points.owned_rows(field) if field in points else np.zeros(0)
        return "maximum", np.array([values.max(initial=0.0)])
    failed = failed_matter.measure(points, points["mass"][: points.owned], name)
    if failed is not None:
        return failed
    if name == "plastic_work":
        return "sum", np.array([plastic_work])
    if name in ("heat", "entropy"):
        return "sum", np.array([getattr(points, name)()])
    lower, upper = points.bounds_of_domains()
    d = points.dimension
    return ("minimum", lower[:d]) if name == "lower_bounds" else ("maximum", upper[:d])


def melting_summary(comm: Any, points: MaterialPoints) -> dict[str, Any]:
    """Particles that have melted if any can; collective."""
    if all(getattr(law, "melting", None) is None for law in points.laws):
        return {}
    parts = [np.zeros(0)]
    for block in points.warm_blocks:
        if block.law.melting is not None:
            temperature = points["temperature"][block.first : block.last]
            parts.append(temperature / melting_temperature(block.law, points.jacobian(block.first, block.last)))
    ratios = np.concatenate(parts)
    return {
        "melted_particles": comm.allreduce(int((ratios >= 1.0).sum())),
        "largest_temperature_over_melting": maximum(comm, float(ratios.max(initial=0.0))),
    }


def first_unsound(points: MaterialPoints, listed: np.ndarray) -> tuple[int, str] | None:
    """See `protocol.ParticleSystem.unsound`; listed: rows of the particles that are in a cell."""
    rows, jacobian = points.owned_rows, points.jacobian(0, points.owned)
    numbers = (rows("velocity"), rows("position"), rows("stress_and_volume"), jacobian[:, None])
    finite = np.all([np.isfinite(values).all(axis=1) for values in numbers], axis=0)
    lost = np.ones(points.owned, bool)
    lost[listed] = False
    for bad, what in (
        (~finite, "a number is no longer finite"),
        (~(jacobian > 0.0), "the Jacobian is not positive: matter is turned inside out"),
        (lost, "it has left the grid"),
    ):
        if bad.any():
            return int(np.argmax(bad)), what
    return None
