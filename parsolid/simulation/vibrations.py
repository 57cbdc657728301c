"""Free vibrations of small amplitude around the initial state of a scene's bodies: frequencies and shapes of modes."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import SolverError, maximum, minimum, raise_together
from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.declaration import Direction, parameters_of
from parsolid.materials.registry import laws_of
from parsolid.methods.peridynamics.tangent import SmallMotion
from parsolid.methods.tlsph.tangent import Tangent
from parsolid.scene import Scene, SceneError
from parsolid.scene.codes import Note
from parsolid.scene.validation_errors import fault as fault_of
from parsolid.simulation.setup import build_systems
from parsolid.solvers import GridLevels, LowestModes, Modes, moduli_of_rows, rigid_modes, rigid_motions, start_vector

# weights whose tangent resists all that strains a body
_WEIGHTS = ("mesh", "cells", "fourth-order")
# by the kind of the method
_TANGENTS: dict[str, Any] = {"tlsph": Tangent, "peridynamics": lambda system: SmallMotion(system.operator)}
# of the square of the lowest frequency of shear waves across the scene, what a motion without stiffness is below
_RIGID = 1e-9
# vectors beyond the wanted ones, which let the last of these converge
_MORE = 4


class Vibrations(NamedTuple):
    """The modes of a scene on one rank, rigid ones first.

    rigid: how many; frequencies (k,) [Hz]; residuals (k,), see `solvers.Modes`; shapes (k, n, d): whose squares times
    the mass add up to 1 kg m^2 over all ranks; shares (k, d): of the mass, what moves along each axis as the whole
    translates, so that those of all modes of a free body add up to 1.
    """

    rigid: int
    frequencies: np.ndarray
    residuals: np.ndarray
    shapes: np.ndarray
    shares: np.ndarray
    found: Modes


class VibratingBodies:
    """The bodies of a scene on one rank with stiffness, mass and constraints; all methods are collective.

    places (n, d) [m]: of this rank's particles; particles: number on all ranks; size [m]: the largest side of all.
    """

    def __init__(self, comm: Any, scene: Scene) -> None:
        """Raises SceneError or SolverError on all ranks for what does not vibrate linearly, or is held all over."""
        refuse_nonlinear(scene)
        self.comm, self.scene = comm, scene
        systems: list[Any] = build_systems(comm, scene, None)[0]
        (self.system,) = systems
        kinds = sorted({kind for kind in getattr(self.system, "body_weights", ()) if kind not in _WEIGHTS})
        factor, fault = scene.method.inertia_factor, None
        if kinds:
            fault = f"method.weights: expected one of {', '.join(_WEIGHTS)} for modes, found {kinds[0]!r}"
        elif factor != 1.0:
            fault = f"method.mass_scaling: expected no such key for modes, which have the true mass, found {factor:g}"
        elif self.system.conditions.rollers:
            fault = "boundaries: expected rollers on planes for modes, found one in a region, inclined to the axes"
        raise_together(comm, fault)
        self.tangent: Any = _TANGENTS[self.system.settings.kind](self.system)
        self.tangent.linearise()
        self.free, self.mass = self.tangent.free, self.tangent.mass[:, None]
        if comm.allreduce(int(self.free.sum())) == 0:
            raise SolverError("boundaries: expected something that moves, found all of it held")
        self.places = np.ascontiguousarray(self.system.particles.owned_rows("reference_position"))
        self.particles = comm.allreduce(len(self.places))
        upper = maximum(comm, self.places.max(axis=0, initial=-np.inf))
        self.size = float(np.max(upper - minimum(comm, self.places.min(axis=0, initial=np.inf))))

    def notes(self) -> list[Note]:
        """What is left out of the linear motion."""
        materials, loads = [one.material for one in self.scene.bodies], self.scene.loads
        loaded = any(one is not None for one in (loads.body_force, loads.acceleration, loads.manufactured))
        relax = [getattr(one, "branches", None) or getattr(one, "terms", None) for one in materials]
        told = {
            "loads do not act": loaded or any(b.kind in ("traction", "pressure") for b in self.scene.boundaries),
            "flow and failure are left out, bodies are elastic": any(m.kind == "elastic-plastic" for m in materials),
            "what relaxes is left out, moduli are those of slow motion": any(relax),
        }
        return [Note("linear-motion", text) for text, here in told.items() if here]

    def joined(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (n, d) that constraints allow: held components do not move, shared nodes move as one."""
        result = vectors * self.free
        self.tangent.share_moves(result)
        return result

    def product(self, u: np.ndarray) -> np.ndarray:
        """K u (n, d) [N] on free components."""
        return np.asarray(self.tangent.product(u) * self.free)

    def preconditioner(self) -> Callable[[np.ndarray], np.ndarray]:
        """About the inverse of K on what constraints allow."""
        particles = self.system.particles
        volume = particles.owned_rows("volume") * self.system.share
        whole = sums(self.comm, [float(volume.sum()), float(len(volume))])
        spacing = float((whole[0] / whole[1]) ** (1.0 / self.places.shape[1]))
        levels = GridLevels(self.comm, self.places, spacing, self.free)
        levels.of_moduli(*moduli_of_rows(self.tangent.laws, len(volume)), volume, self.tangent.diagonal())
        return lambda residual: self.joined(levels(residual))

    def rigid_modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Shapes (l, n, d) of motions that nothing resists, and w^2 (l,) [1/s^2] of rounding."""
        # translations and turns (k, n, d) of each body about its middle
        n, body, result = len(self.places), self.system.particles.owned_rows("body"), list[np.ndarray]()
        for number in range(len(self.system.bodies)):
            here = (body == number)[:, None]
            mass, *moment = sums(self.comm, (here * self.mass * np.hstack((np.ones((n, 1)), self.places))).sum(axis=0))
            result += list(here * rigid_motions(self.places - np.array(moment) / mass))
        motions = np.array([self.joined(one) for one in result])
        speeds = [shear / density for _, _, shear, _, density in self.tangent.laws]
        least = _RIGID * minimum(self.comm, min(speeds, default=np.inf)) / self.size**2
        shapes, squares = rigid_modes(self.comm, motions, self.product, self.mass, least)
        # shapes with the same span, of which the first are translations where they are among it
        parts = sums(self.comm, np.tensordot(shapes * self.mass, motions, ((1, 2), (1, 2))))
        basis = np.zeros((0, len(shapes)))
        for part in parts.T:
            for _ in range(2):
                part = part - basis.T @ (basis @ part)
            if np.linalg.norm(part) > 1e-6 * np.linalg.norm(parts):
                basis = np.vstack((basis, part / np.linalg.norm(part)))
        return np.asarray(np.tensordot(basis, shapes, 1)) if len(basis) == len(shapes) else shapes, squares

    def find(self, count: int, tolerance: float, limit: int) -> Vibrations:
        """The rigid modes and the lowest `count` others."""
        n, d = self.places.shape
        rigid, of_rigid = self.rigid_modes()
        precondition = self.preconditioner()
        block = min(count + _MORE, max(1, self.comm.allreduce(int(self.free.sum())) - len(rigid)))
        rough = start_vector(self.system.particles.owned_rows("identifier"), d * block).reshape(n, block, d)
        start = np.array([precondition(self.mass * self.joined(one)) for one in rough.swapaxes(0, 1)])
        solver = LowestModes(self.comm, self.product, self.mass, precondition, rigid)
        found = solver.find(start, count, tolerance, limit)
        shapes = np.concatenate((rigid, found.shapes))
        squares = np.concatenate((of_rigid, found.squares))
        frequencies = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
        residuals = np.concatenate((np.zeros(len(rigid)), found.residuals))
        momenta = sums(self.comm, np.tensordot(shapes, np.broadcast_to(self.mass, (n, 1)), ((1,), (0,)))[:, :, 0])
        shares = momenta**2 / float(sums(self.comm, [float(self.mass.sum())])[0])
        return Vibrations(len(rigid), frequencies, residuals, shapes, shares, found)


def refuse_nonlinear(scene: Scene) -> None:
    """Raise SceneError for what of a scene does not vibrate linearly, or not by this method."""
    meeting = [name for name in ("contact", "tie", "tools") if getattr(scene, name)]
    faults = [fault_of((name,), "none for modes, whose bodies are linear", getattr(scene, name)) for name in meeting]
    springs = [number for number, one in enumerate(scene.boundaries) if one.kind == "spring"]
    faults += [fault_of(("boundaries", i, "kind"), "no spring for modes", "spring") for i in springs]
    rough = [number for number, one in enumerate(scene.bodies) if one.shape.kind == "perforated_box"]
    faults += [fault_of(("bodies", i, "shape"), "a box or a mesh for modes", "perforated_box") for i in rough]
    for i, body in enumerate(scene.bodies):
        notes = [note for _, note in parameters_of(getattr(body.material, "declared", object)).values()]
        expected = ""
        if not any(isinstance(note, Direction) for note in notes):
            continue
        if getattr(body.material, "bears_tension_alone", False):
            expected = "a law as stiff in compression as in tension for modes"
        elif scene.systems[0].settings.kind == "peridynamics":
            expected = "'tlsph', or a law without fibres, for modes"
        if expected:
            faults.append(fault_of(("bodies", i, "material", "kind"), expected, body.material.kind, "method"))
    systems = scene.systems
    if len(systems) > 1:
        faults.append(fault_of(("methods",), "one method for modes", len(systems)))
    elif systems[0].settings.kind not in _TANGENTS:
        expected = f"{' or '.join(map(repr, _TANGENTS))} for modes"
        faults.append(fault_of((*systems[0].place, "kind"), expected, systems[0].settings.kind, "method"))
    elif any(isinstance(law, BondBased) for law in laws_of(scene.part(systems[0]))):
        faults.append(fault_of(("bodies",), "laws with elastic moduli for modes", "a bond-based one", "method"))
    if faults:
        raise SceneError(faults)
