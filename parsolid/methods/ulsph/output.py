"""What is shown and measured of updated-Lagrangian SPH besides its fields."""

from typing import Any

import numpy as np

from parsolid.methods import failed_matter


def shown(system: Any, name: str, first: int, last: int) -> np.ndarray | None:
    """Cauchy stress (n, 3, 3) [Pa], Jacobian rho_0/rho (n,), internal energy per reference volume (n,) [J/m^3] of
    particles first..last-1; None for other names."""
    rows = system.particles.owned_rows
    if name == "jacobian":
        density = np.array([law.density for law in system.laws])[system.particles.law_of_body]
        return np.asarray(density[rows("body")[first:last]] / rows("density")[first:last])
    if name == "internal_energy":
        return np.asarray(rows("energy")[first:last])
    if name != "stress":
        return None
    result = np.zeros((last - first, 3, 3))
    components = rows("deviator")[first:last].T
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    for (i, j), values in zip(places, components):
        result[:, i, j] = result[:, j, i] = values
    for solid, here in system.parts():
        a, b = max(first, here.start), min(last, here.stop)
        if a < b:
            pressure = solid.pressures(system.particles, slice(a, b))
            result[a - first : b - first, (0, 1, 2), (0, 1, 2)] -= pressure[:, None]
    return result


def measure(system: Any, name: str) -> tuple[str, np.ndarray]:
    """ "sum", "minimum" or "maximum", and this rank's part, of one of the settings' quantities."""
    rows, mass = system.particles.owned_rows, system.mass
    failed = failed_matter.measure(system.particles, mass, name)
    if failed is not None:
        return failed
    if name == "maximum_deviator_norm":
        squares = rows("deviator") ** 2
        shears = squares[:, 3:].sum(axis=1)
        return "maximum", np.array([np.sqrt((squares.sum(axis=1) + shears).max(initial=0.0))])
    if name.startswith("maximum_"):
        return "maximum", np.array([rows(name.removeprefix("maximum_")).max(initial=0.0)])
    if name == "mean_plastic_strain":
        return "sum", np.array([float(mass @ rows("plastic_strain")) / system.whole_mass])
    if name == "micro_kinetic":
        return "sum", np.array([sum(solid.energies(system.particles, here)[0] for solid, here in system.parts())])
    if name == "heat":
        capacity = np.array([law.specific_heat for law in system.laws])[system.particles.law_of_body]
        return "sum", np.array([float((capacity[rows("body")] * mass) @ rows("temperature"))])
    half = 0.5 * rows("spacing")
    if name == "lower_bounds":
        return "minimum", (rows("position") - half).min(axis=0, initial=np.inf)
    return "maximum", (rows("position") + half).max(axis=0, initial=-np.inf)


def unsound(system: Any) -> tuple[int, str] | None:
    """The rank's first particle that is not sound, and what is wrong with it."""
    rows = system.particles.owned_rows
    density, finite = rows("density"), np.isfinite(rows("velocity")).all(axis=1)
    for name in ("deviator", "temperature", "plastic_strain"):
        values = rows(name)
        finite &= np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
    bad = ~finite | ~(density > 0.0)
    if not bad.any():
        return _beyond_its_law(system)
    index = int(np.argmax(bad))
    if not finite[index]:
        return index, "a number is no longer finite"
    return index, f"the density is {density[index]:.4g} kg/m^3, not positive"


def _beyond_its_law(system: Any) -> tuple[int, str] | None:
    """The first particle beyond what its law describes, and what is wrong with it."""
    for solid, here in system.parts():
        room = solid.room(system.particles, here)
        if room is not None and not (room > 0.0).all():
            index = here.start + int(np.argmin(room))
            ratio = solid.law.density / system.particles.owned_rows("density")[index]
            return index, f"it is compressed beyond its equation of state (to {ratio:.4g} of its volume)"
    return None


def advice(settings: Any) -> str:
    """What most likely helps when a run goes wrong."""
    hints = [f"a smaller method.cfl (it is {settings.cfl:g}; 0.3 is stable)"] if settings.cfl > 0.3 else []
    if not settings.viscosity:
        hints.append("method.viscosity (there is none)")
    return ", or ".join([*hints, "more particles", "a milder load"])
