"""The driver: a law's state along a path, with the work that the stress does and the energy that is dissipated.

Stored energy (from the energy function), work (from the stress) and dissipation (from its rate) are found independently
of each other, so that work - dissipation - change of the stored energy measures the error of the steps. It vanishes but
for rounding where nothing is approximated: at a fixed deformation and in a jump.
"""

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.micro_inertia import MicroInertia
from parsolid.materials.viscoelastic.prony import Prony
from parsolid.point.laws import MaxwellPoint, PathLost, PointLaw
from parsolid.point.micro_inertia import MicroInertiaPoint
from parsolid.point.paths import Path
from parsolid.point.plastic import PlasticPoint
from parsolid.point.viscoelastic import PronyPoint
from parsolid.scene.probes import component_names

POINT_LAWS = {
    ElasticPlastic: PlasticPoint,
    MicroInertia: MicroInertiaPoint,
    Prony: PronyPoint,
}


def point_law(parameters: Any, **conditions: Any) -> PointLaw:
    """The law of a material point with the given parameters, a hyperelastic one unless their type is in `POINT_LAWS`;
    conditions: keywords of its class."""
    chosen = next((POINT_LAWS[kind] for kind in type(parameters).__mro__ if kind in POINT_LAWS), MaxwellPoint)
    return chosen(parameters, **conditions)


# Gauss-Lobatto points of a step, from its start to its end
NODES = 0.5 + 0.5 * np.array([-1.0, -np.sqrt(3.0 / 7.0), 0.0, np.sqrt(3.0 / 7.0), 1.0])


@dataclass
class Record:
    """Times [s] and states along a path, and work and dissipation [J/m^3] accumulated since time 0."""

    times: list[float] = field(default_factory=list)
    states: list[Any] = field(default_factory=list)
    work: list[float] = field(default_factory=list)
    dissipation: list[float] = field(default_factory=list)

    def add(self, time: float, state: Any, work: float = 0.0, dissipation: float = 0.0) -> None:
        """A state, with the work done and the energy dissipated since the one before."""
        self.times.append(time)
        self.states.append(state)
        self.work.append(work + (self.work[-1] if self.work else 0.0))
        self.dissipation.append(dissipation + (self.dissipation[-1] if self.dissipation else 0.0))


def integrate(law: PointLaw, path: Path, end_time: float, longest_step: float) -> Record:
    """Follow a path from the virgin state to the end time in steps no longer than the given one [s].

    A step ends wherever the path has a break; a jump takes no time, and has two states at its time. Raises PathLost.
    """
    record = Record()
    record.add(0.0, law.initial_state())
    kinks = {time for time in path.kinks if 0.0 < time <= end_time}
    edges = sorted({0.0, end_time} | kinks)
    _jump(record, law, path, 0.0)
    for start, end in itertools.pairwise(edges):
        count = max(1, int(np.ceil((end - start) / longest_step * (1.0 - 1e-9))))
        times = start + (end - start) * np.arange(count + 1) / count
        times[-1] = end
        for k in range(count):
            _step(record, law, path, times[k], times[k + 1])
        if end in kinks:
            _jump(record, law, path, end)
    return record


def tabulate(law: PointLaw, record: Record, directions: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of point.csv, (n,) each, in SI units; directions (k, 3) are those of the wave speeds."""
    F = law.deformations(record.states)
    P = np.array([law.stress(state) for state in record.states])
    J = np.linalg.det(F)
    stress = P @ np.swapaxes(F, 1, 2) / J[:, None, None]
    pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
    deviator = stress + pressure[:, None, None] * np.eye(3)
    columns = {"time": np.array(record.times)}
    for name, tensors in (("deformation_gradient", F), ("first_piola_kirchhoff_stress", P), ("stress", stress)):
        columns |= dict(zip(component_names(name, 3), tensors.reshape(-1, 9).T))
    columns |= {
        "jacobian": J,
        "pressure": pressure,
        "von_mises_stress": np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator)),
        "strain_energy": law.energies(record.states),
        "work": np.array(record.work),
        "dissipation": np.array(record.dissipation),
    }
    stored = columns["strain_energy"]
    columns["energy_error"] = columns["work"] - columns["dissipation"] - (stored - stored[0])
    return columns | law.columns(record.states, directions)


def _step(record: Record, law: PointLaw, path: Path, start: float, end: float) -> None:
    """One step; the work is the integral of P : dF of polynomials through the nodes."""
    step, before = end - start, record.states[-1]
    times = start + step * NODES
    times[-1] = end
    targets = path.gradients(times, np.array([1, 0, 0, 0, -1]))
    states = [before]
    for k in range(1, len(NODES)):
        states.append(_solve_free(law, before, states[-1], path, targets[k], times[k], step * NODES[k]))
    F = law.deformations(states) - law.deformations(states[:1])
    P = np.array([law.stress(state) for state in states])
    work = np.einsum("ab,aij,bij->", _WORK, P, F)
    record.add(end, states[-1], work, law.dissipated(before, states[-1], step))


def _jump(record: Record, law: PointLaw, path: Path, time: float) -> None:
    """A jump of the path, if there is one: the stress does as much work as is stored and dissipated."""
    before = record.states[-1]
    present = law.deformations([before])[0]
    target = path.gradients(np.array([time]), np.array([1]))[0]
    prescribed = ~np.diag(path.free)
    if np.abs((target - present)[prescribed]).max() <= 1e-11 * np.abs(present).max():
        return
    after = _solve_free(law, before, before, path, target, time, 0.0)
    lost = law.dissipated(before, after, 0.0)
    stored = law.energies([before, after])
    record.add(time, after, stored[1] - stored[0] + lost, lost)


def _solve_free(law: PointLaw, before: Any, near: Any, path: Path, target: np.ndarray, time: float, step: float) -> Any:
    """The state at a target F; its free components are such that their stress vanishes, found from those nearby.

    Newton's method with a numerical tangent, damped so that no component loses more than half of itself.
    """
    free = np.flatnonzero(path.free)
    F = np.array(target)
    if len(free):
        F[free, free] = law.deformations([near])[0][free, free]
    for _ in range(60):
        state = _advanced(law, before, F, time, step)
        if not len(free):
            return state
        residual = law.stress(state)[free, free]
        change = np.linalg.lstsq(_tangent(law, before, F, free, time, step), -residual, rcond=None)[0]
        stretch = F[free, free]
        shrink = np.max(-change / (0.5 * np.abs(stretch)), initial=1.0)
        F = F.copy()
        F[free, free] += change / shrink
        # quadratic convergence: what is left after this change is far below rounding
        if np.abs(change).max() <= 1e-10 * np.abs(stretch).max():
            return _advanced(law, before, F, time, step)
    raise PathLost(f"no free stretches make the lateral stress vanish at t = {time:g} s; try shorter steps")


def _tangent(law: PointLaw, before: Any, F: np.ndarray, free: np.ndarray, time: float, step: float) -> np.ndarray:
    """Derivatives [Pa] of the free stresses with respect to the free stretches."""
    columns = []
    for i in free:
        stresses, size = [], 1e-5 * abs(F[i, i])
        for sign in (1.0, -1.0):
            moved = F.copy()
            moved[i, i] += sign * size
            stresses.append(law.stress(_advanced(law, before, moved, time, step))[free, free])
        columns.append((stresses[0] - stresses[1]) / (2.0 * size))
    return np.array(columns).T


def _advanced(law: PointLaw, before: Any, F: np.ndarray, time: float, step: float) -> Any:
    J = np.linalg.det(F) if np.isfinite(F).all() else np.nan
    if not J > 0.0:
        raise PathLost(f"the deformation gradient has J = {J:g} at t = {time:g} s (J > 0 expected)")
    return law.updated(before, F, step)


def _work_matrix() -> np.ndarray:
    """Integrals over a step of l_a dl_b/ds, l the Lagrange polynomials of the nodes."""
    points, weights = np.polynomial.legendre.leggauss(len(NODES))
    s = 0.5 + 0.5 * points
    values, slopes = [], []
    for a, node in enumerate(NODES):
        polynomial = np.poly1d(np.delete(NODES, a), r=True)
        polynomial = polynomial / polynomial(node)
        values.append(polynomial(s))
        slopes.append(polynomial.deriv()(s))
    return np.einsum("q,aq,bq->ab", 0.5 * weights, values, slopes)


_WORK = _work_matrix()
