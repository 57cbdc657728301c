"""Parts with exact or converged answers, by the weights of their meshes and by linear elements on the same nodes:
python benchmarks/real_parts.py [CASE ...] [--meshes N], the tables of docs/real-parts.md.

Statics of small strain are solved with the forces of a step as they are; motions are run. Needs the extra "cad".
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import gmsh
import meshio
import numpy as np
from linear_elements import LinearElements, at_rest, quadratic_stiffness, second_order
from mpi4py import MPI
from scipy.sparse.linalg import LinearOperator, cg

import parsolid
from parsolid.simulation.history import HistoryOutput

E, NU, SOFT = 1.0, 0.3, 0.4999
PULL = 1e-6
# removed when the program ends
FOLDER = tempfile.TemporaryDirectory()
FILE = str(Path(FOLDER.name) / "part.vtu")


class Mesh(NamedTuple):
    """Places (n, d) and simplices (elements, d + 1)."""

    X: np.ndarray
    cells: np.ndarray


class Row(NamedTuple):
    """Number of nodes; values by name, of parsolid and of finite elements; core-seconds of both."""

    nodes: int
    own: dict[str, float]
    elements: dict[str, float]
    seconds: tuple[float, float]


# --- meshes ------------------------------------------------------------------------------------------------------


def meshed(draw: Callable[[Any], Any], dimension: int, size: float, options: dict[str, float] | None = None) -> Mesh:
    """The mesh of what a function draws with OpenCASCADE, of elements of one size unless it sets others."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    for key, value in {
        "General.Terminal": 0, "General.NumThreads": 1, "Mesh.MeshSizeMax": size, "Mesh.MeshSizeMin": size,
        "Mesh.OptimizeNetgen": 1, **(options or {}),
    }.items():  # fmt: skip
        gmsh.option.setNumber(key, value)
    draw(gmsh.model.occ)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(dimension)
    tags, X, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    kind = {2: 2, 3: 4}[dimension]
    cells = np.searchsorted(tags[order], gmsh.model.mesh.getElementsByType(kind)[1]).reshape(-1, dimension + 1)
    X = X.reshape(-1, 3)[order, :dimension]
    gmsh.finalize()
    used, number = np.unique(cells, return_inverse=True)
    # on planes to the last bit
    X = np.where(np.abs(X[used]) < 1e-12, 0.0, X[used])
    return Mesh(X, number.reshape(cells.shape))


def ring(m: int, outer: float, whole: bool = False) -> Mesh:
    """A quarter of a ring of inner radius 1, or all of it, m elements a unit length."""

    def draw(occ: Any) -> None:
        occ.cut([(2, occ.addDisk(0, 0, 0, outer, outer))], [(2, occ.addDisk(0, 0, 0, 1, 1))])
        if not whole:
            occ.intersect([(2, 1)], [(2, occ.addRectangle(0, 0, 0, outer, outer))])

    return meshed(draw, 2, 1.0 / m)


# --- one part by both ----------------------------------------------------------------------------------------------


def scene(mesh: Mesh, boundaries: list[dict[str, Any]], nu: float = NU, **rest: Any) -> dict[str, Any]:
    """Tables of a body of the mesh."""
    d = mesh.X.shape[1]
    kind = {2: "triangle", 3: "tetra"}[d]
    meshio.write(FILE, meshio.Mesh(np.pad(mesh.X, ((0, 0), (0, 3 - d))), [(kind, mesh.cells)]))
    material = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": E, "poissons_ratio": nu}
    body = {"shape": {"mesh": {"file": FILE}}, "material": material}
    output = {"history_steps": 1_000_000, "fields_times": [], "pictures": False}
    plain = {"dimension": d, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body], "output": output}
    return plain | {"boundaries": boundaries} | rest


class Static:
    """A part at rest in small strain: displacements (n, d) and stresses (n, 3, 3) at nodes by both."""

    def __init__(
        self, mesh: Mesh, boundaries: list[dict[str, Any]], nu: float = NU, held: np.ndarray | None = None, **rest: Any
    ) -> None:
        """held (n, d): displacements, in the order of the mesh, of nodes that are held there, others not a number."""
        simulation = parsolid.Simulation(scene(mesh, boundaries, nu, **rest))
        self.mesh, self.nu, self.simulation = mesh, nu, simulation
        self.system = simulation.core.systems[0]
        of, conditions = self.system.particles.owned_rows, self.system.conditions
        # rows of the system have another order than nodes of the mesh
        self.row = np.argsort(of("identifier"))
        self.free = np.ones(mesh.X.shape, bool) if conditions.free is None else conditions.free.T[: len(mesh.X)] > 0.0
        self.load, self.held = conditions.surface_forces(0.0).T, np.zeros(mesh.X.shape)
        if held is not None:
            number = np.argsort(self.row)
            self.free &= np.isnan(held[number])
            self.held = np.nan_to_num(held[number])
        began = time.process_time()
        self.u = self._by_weights()
        self.seconds = time.process_time() - began, 0.0

    def _by_weights(self) -> np.ndarray:
        free, forces = self.free.ravel(), self.system.meshes._linear_forces()

        def stiffness(u: np.ndarray) -> np.ndarray:
            full = np.zeros(free.size)
            full[free] = u
            return -forces(full.reshape(self.free.shape)).ravel()[free]

        count = int(free.sum())
        right = (self.load + forces(self.held)).ravel()[free]
        found, failed = cg(LinearOperator((count, count), stiffness), right, rtol=1e-8, maxiter=200 * count)
        if failed:
            raise SystemExit("no solution")
        u = self.held.ravel().copy()
        u[free] = found
        return u.reshape(self.free.shape)

    def reactions(self) -> np.ndarray:
        """Forces (n, d) that hold the nodes, in the order of the mesh."""
        return -(self.system.meshes._linear_forces()(self.u) + self.load)[self.row]

    def stress(self, name: str = "nodal_stress") -> np.ndarray:
        """Of the solution, by a field."""
        of, d = self.system.particles.owned_rows, self.mesh.X.shape[1]
        of("position")[:] = of("reference_position") + self.u
        of("deformation_gradient")[:] = np.eye(d).ravel()
        self.system.complete_strain(np.ones(self.system.owned, bool))
        return self.simulation.field(name)[self.row]

    def displacement(self) -> np.ndarray:
        """(n, d), in the order of the mesh."""
        return self.u[self.row]

    def by_elements(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n, d) and stresses (n, 3, 3), means of the elements around by their volume, of linear finite
        elements with the same loads."""
        began = time.process_time()
        elements = LinearElements(*self.mesh, E, self.nu)
        u = elements.displacement(self.free[self.row], self.load[self.row], self.held[self.row])
        self.seconds = self.seconds[0], time.process_time() - began
        return u, elements.stresses(u)


SYMMETRY = [{"kind": "roller", "plane": "X = 0"}, {"kind": "roller", "plane": "Y = 0"}]
RADIUS = "sqrt(X**2 + Y**2)"


# --- cases ---------------------------------------------------------------------------------------------------------


def hole(m: int) -> Row:
    """Plate with a hole of radius 1 (Kirsch), m spacings a radius: peak stress over 3 less 1."""
    mesh = ring(m, 4.0)
    # tractions of the infinite plate at the outer edge, in Cartesian components by angles
    c2, s2 = f"((X**2 - Y**2)/{RADIUS}**2)", f"(2*X*Y/{RADIUS}**2)"
    a2 = f"(1/{RADIUS}**2)"
    radial = f"({PULL / 2}*(1 - {a2}) + {PULL / 2}*(1 - 4*{a2} + 3*{a2}**2)*{c2})"
    shear = f"(-{PULL / 2}*(1 + 2*{a2} - 3*{a2}**2)*{s2})"
    traction = [f"({radial}*X - {shear}*Y)/{RADIUS}", f"({radial}*Y + {shear}*X)/{RADIUS}"]
    outside = {"kind": "traction", "where": "outside", "traction": traction}
    regions = [{"name": "outside", "formula": f"{RADIUS} > 3.999"}]
    part = Static(mesh, [*SYMMETRY, outside], regions=regions)
    edge = np.flatnonzero(np.hypot(*mesh.X.T) < 1.001)
    x, y = mesh.X[edge].T
    T, exact = np.stack([-y, x], axis=1), PULL * (1 + 2 * (y * y - x * x))

    def errors(stress: np.ndarray) -> dict[str, float]:
        around = np.einsum("ni,nij,nj->n", T, stress[edge, :2, :2], T)
        return {"peak": around.max() / (3 * PULL) - 1, "worst": np.abs(around - exact).max() / (3 * PULL)}

    found = errors(part.stress()) | {f"{key}, particles": one for key, one in errors(part.stress("stress")).items()}
    return Row(len(mesh.X), found, errors(part.by_elements()[1]), part.seconds)


def ellipse(m: int) -> Row:
    """Elliptic hole 1 x .5 across a tension (Inglis): peak stress over 5 less 1; m spacings in the radius there."""
    far, tip = 30.0, 0.25

    def draw(occ: Any) -> None:
        occ.cut([(2, occ.addDisk(0, 0, 0, far, far))], [(2, occ.addDisk(0, 0, 0, 1, 0.5))])
        occ.intersect([(2, 1)], [(2, occ.addRectangle(0, 0, 0, far, far))])
        gmsh.model.mesh.setSizeCallback(
            lambda dimension, tag, x, y, z, size: tip / m + 0.1 * max(np.hypot(x - 1.0, y) - tip, 0.0)
        )

    mesh = meshed(draw, 2, 2.0, {"Mesh.MeshSizeMin": tip / m})
    pull = ["0", f"{PULL}*abs(Y)/{RADIUS}"]
    regions = [{"name": "outside", "formula": f"{RADIUS} > {far - 0.001}"}]
    part = Static(mesh, [*SYMMETRY, {"kind": "traction", "where": "outside", "traction": pull}], regions=regions)
    at = np.argmin(np.hypot(mesh.X[:, 0] - 1.0, mesh.X[:, 1]))

    def errors(stress: np.ndarray) -> dict[str, float]:
        return {"peak": stress[at, 1, 1] / (5 * PULL) - 1}

    found = errors(part.stress()) | {"peak, particles": errors(part.stress("stress"))["peak"]}
    return Row(len(mesh.X), found, errors(part.by_elements()[1]), part.seconds)


def sphere(m: int) -> Row:
    """Thick sphere 1 < r < 2 under inner pressure (Lame), m spacings a unit length: at the bore."""

    def draw(occ: Any) -> None:
        whole = occ.cut([(3, occ.addSphere(0, 0, 0, 2))], [(3, occ.addSphere(0, 0, 0, 1))])[0]
        occ.intersect(whole, [(3, occ.addBox(0, 0, 0, 2, 2, 2))])

    mesh = meshed(draw, 3, 1.0 / m)
    planes = [*SYMMETRY, {"kind": "roller", "plane": "Z = 0"}]
    regions = [{"name": "bore", "formula": "sqrt(X**2 + Y**2 + Z**2) < 1.001"}]
    part = Static(mesh, [*planes, {"kind": "pressure", "where": "bore", "pressure": PULL}], regions=regions)
    inner = np.flatnonzero(np.linalg.norm(mesh.X, axis=1) < 1.001)
    hoop, u = PULL * (8 + 2) / 14, PULL / E / 7 * ((1 - 2 * NU) + (1 + NU) * 4)

    def errors(displacement: np.ndarray, stress: np.ndarray) -> dict[str, float]:
        N, sigma = mesh.X[inner], stress[inner]
        across = np.einsum("ni,nij,nj->n", N, sigma, N)
        around = 0.5 * (np.einsum("nii->n", sigma) - across)
        moved = np.einsum("ni,ni->n", N, displacement[inner])
        return {
            "hoop stress, mean": around.mean() / hoop - 1, "rms": np.sqrt(np.mean((around / hoop - 1) ** 2)),
            "worst": np.abs(around / hoop - 1).max(), "radial stress": np.abs(across / PULL + 1).max(),
            "displacement": moved.mean() / u - 1,
        }  # fmt: skip

    found = errors(part.displacement(), part.stress())
    found |= {"hoop, particles": errors(part.displacement(), part.stress("stress"))["hoop stress, mean"]}
    return Row(len(mesh.X), found, errors(*part.by_elements()), part.seconds)


def cylinder(m: int) -> Row:
    """Thick cylinder 1 < r < 2 under inner pressure (Lame): hoop and radial stress at the bore, its displacement."""
    mesh = ring(m, 2.0)
    bore = {"kind": "pressure", "where": "bore", "pressure": PULL}
    part = Static(mesh, [*SYMMETRY, bore], regions=[{"name": "bore", "formula": f"{RADIUS} < 1.001"}])
    inner = np.flatnonzero(np.hypot(*mesh.X.T) < 1.001)
    hoop, u = PULL * (4 + 1) / (4 - 1), PULL * (1 + NU) / E * ((1 - 2 * NU) + 4.0) / 3.0

    def errors(displacement: np.ndarray, stress: np.ndarray) -> dict[str, float]:
        N = mesh.X[inner]
        T = np.stack([-N[:, 1], N[:, 0]], axis=1)
        around = np.einsum("ni,nij,nj->n", T, stress[inner, :2, :2], T)
        across = np.einsum("ni,nij,nj->n", N, stress[inner, :2, :2], N)
        moved = np.einsum("ni,ni->n", N, displacement[inner])
        return {
            "hoop stress, mean": around.mean() / hoop - 1, "worst": np.abs(around / hoop - 1).max(),
            "radial stress": np.abs(across / PULL + 1).max(), "displacement": moved.mean() / u - 1,
        }  # fmt: skip

    return Row(len(mesh.X), errors(part.displacement(), part.stress()), errors(*part.by_elements()), part.seconds)


def bushing(m: int) -> Row:
    """Bushing 1 < r < 2, outside held, bore turned a little, m spacings a unit length: torque, shear at the bore."""
    mesh, angle = ring(m, 2.0, whole=True), 1e-6
    r = np.hypot(*mesh.X.T)
    inner, held = r < 1.001, np.where((r > 1.999)[:, None], 0.0, np.nan) * np.ones(2)
    turned = angle * np.stack([-mesh.X[:, 1], mesh.X[:, 0]], axis=1)
    held[inner] = turned[inner]
    regions = [{"name": "ends", "formula": f"({RADIUS} < 1.001) | ({RADIUS} > 1.999)"}]
    part = Static(mesh, [{"kind": "fixed", "where": "ends"}], held=held, regions=regions)
    exact = 4 * np.pi * E / (2 + 2 * NU) * angle / (1 - 1 / 4)

    def errors(force: np.ndarray, stress: np.ndarray) -> dict[str, float]:
        (x, y), (fx, fy) = mesh.X[inner].T, force[inner].T
        shear = np.einsum("ni,nij,nj->n", np.stack([-y, x], axis=1), stress[inner, :2, :2], np.stack([x, y], axis=1))
        return {"torque": np.sum(x * fy - y * fx) / exact - 1, "shear": -shear.mean() / (exact / (2 * np.pi)) - 1}

    u, stress = part.by_elements()
    force = (LinearElements(*mesh, E, NU).stiffness() @ u.ravel()).reshape(u.shape)
    found = errors(part.reactions(), part.stress())
    found["shear, particles"] = errors(part.reactions(), part.stress("stress"))["shear"]
    return Row(len(mesh.X), found, errors(force, stress), part.seconds)


def cook(m: int, nu: float = 1.0 / 3.0) -> Row:
    """Cook's membrane, m x m squares halved, nu 1/3: the tip's rise, against elements of second order."""
    mesh = trapezium(m)
    right = {"kind": "traction", "plane": "X = 48", "traction": ["0", f"{PULL / 16}"]}
    part = Static(mesh, [{"kind": "fixed", "plane": "X = 0"}, right], nu)
    tip = np.argmin(np.hypot(mesh.X[:, 0] - 48, mesh.X[:, 1] - 60))
    exact = tip_of_second_order(nu)
    own, other = part.displacement()[tip, 1], part.by_elements()[0][tip, 1]
    return Row(len(mesh.X), {"rise": own / exact - 1}, {"rise": other / exact - 1}, part.seconds)


def equilibrium(mesh: Mesh, boundaries: list[dict[str, Any]], nu: float, **rest: Any) -> tuple[Any, np.ndarray, float]:
    """The system of a part in equilibrium, displacements (n, d) in the order of the mesh, core-seconds of the run."""
    method = {"kind": "tlsph", "integrator": "static"}
    simulation = parsolid.Simulation(scene(mesh, boundaries, nu, method=method, **rest))
    began = time.process_time()
    simulation.core.run(None, [])
    system = simulation.core.systems[0]
    of = system.particles.owned_rows
    return system, of("displacement")[np.argsort(of("identifier"))], time.process_time() - began


def soft_cook(m: int) -> Row:
    """Cook's membrane, m x m squares halved, nu .4999, in equilibrium: the tip's rise, against elements of second
    order."""
    mesh, exact = trapezium(m), tip_of_second_order(SOFT)
    fixed, load = {"kind": "fixed", "plane": "X = 0"}, f"{PULL / 16}*t"
    u, seconds = equilibrium(mesh, [fixed, {"kind": "traction", "plane": "X = 48", "traction": ["0", load]}], SOFT)[1:]
    tip = np.argmin(np.hypot(mesh.X[:, 0] - 48, mesh.X[:, 1] - 60))
    of_elements = cook(m, SOFT)
    return Row(
        len(mesh.X),
        {"rise": u[tip, 1] / exact - 1, "rise by volumes of nodes": of_elements.own["rise"]},
        of_elements.elements,
        (seconds, of_elements.seconds[1]),
    )


def soft_torsion(m: int) -> Row:
    """Column 1 x 2 x 1, nu .4999, in equilibrium, one end turned: torque (Saint-Venant), m spacings a side."""

    def draw(occ: Any) -> None:
        # with a node in the middle of the end that stays
        occ.fragment([(3, occ.addBox(-0.5, 0, -0.5, 1, 2, 1))], [(0, occ.addPoint(0, 0, 0))])

    mesh, angle = meshed(draw, 3, 1.0 / m), 1e-6
    (x, y, z), u = mesh.X.T, np.full(mesh.X.shape, np.nan)
    exact = 0.1405770 * E / (2 + 2 * SOFT) * angle / 2.0
    u[y < 1e-9, ::2], u[np.linalg.norm(mesh.X, axis=1) < 1e-9, 1] = 0.0, 0.0
    end = y > 2 - 1e-9
    u[end, 0], u[end, 2] = angle * z[end], -angle * x[end]
    boundaries = [
        {"kind": "displacement", "plane": "Y = 0", "displacement": ["0", "free", "0"]},
        {"kind": "displacement", "where": "middle", "displacement": ["0", "0", "0"]},
        {"kind": "displacement", "plane": "Y = 2", "displacement": [f"{angle}*t*Z", "free", f"-{angle}*t*X"]},
    ]
    regions = [{"name": "middle", "formula": "X**2 + Y**2 + Z**2 < 1e-18"}]
    system, _, seconds = equilibrium(mesh, boundaries, SOFT, regions=regions)

    def torque(force: np.ndarray) -> float:
        return float(np.sum(z[end] * force[end, 0] - x[end] * force[end, 2])) / exact - 1

    rows, began = np.argsort(system.particles.owned_rows("identifier")), time.process_time()
    elements = LinearElements(*mesh, E, SOFT)
    K, free = elements.stiffness(), np.isnan(u)
    of_elements = (K @ at_rest(K, free, np.zeros_like(u), np.nan_to_num(u)).ravel()).reshape(u.shape)
    both = seconds, time.process_time() - began
    own = torque(-system.statics.internal_force()[rows])
    return Row(len(mesh.X), {"torque": own}, {"torque": torque(of_elements)}, both)


def bracket(m: int) -> Row:
    """L-bracket, arms of 1 x 3 with a fillet of .5, one end held, the other under shear, m spacings a unit length: the
    corner's fall and the largest stress along the fillet, against elements of second order."""
    mesh = angle(m)
    right = {"kind": "traction", "plane": "X = 3", "traction": ["0", f"{-PULL}"]}
    part = Static(mesh, [{"kind": "fixed", "plane": "Y = 3"}, right])
    corner, edge = np.argmin(np.hypot(mesh.X[:, 0] - 3, mesh.X[:, 1])), fillet(mesh.X)
    fall, peak = bracket_of_second_order()

    def errors(u: np.ndarray, stress: np.ndarray) -> dict[str, float]:
        x, y = (mesh.X[edge] - 1.5).T / 0.5
        T = np.stack([-y, x], axis=1)
        along = np.einsum("ni,nij,nj->n", T, stress[edge, :2, :2], T)
        return {"fall": u[corner, 1] / fall - 1, "peak": np.abs(along).max() / peak - 1}

    return Row(len(mesh.X), errors(part.displacement(), part.stress()), errors(*part.by_elements()), part.seconds)


def fillet(X: np.ndarray) -> np.ndarray:
    """Whether places (n, 2) are on the bracket's fillet."""
    return (np.abs(np.hypot(*(X - 1.5).T) - 0.5) < 1e-6) & (X < 1.5 + 1e-9).all(axis=1)


def angle(m: int) -> Mesh:
    """The bracket."""

    def draw(occ: Any) -> None:
        places = [(0, 0), (3, 0), (3, 1), (1.5, 1), (1, 1.5), (1, 3), (0, 3)]
        points, middle = [occ.addPoint(*place, 0) for place in places], occ.addPoint(1.5, 1.5, 0)
        lines = [occ.addLine(a, b) for a, b in zip(points, [*points[1:], points[0]])]
        lines[3] = occ.addCircleArc(points[3], middle, points[4])
        occ.addPlaneSurface([occ.addCurveLoop(lines)])

    return meshed(draw, 2, 1.0 / m)


@cache
def bracket_of_second_order() -> tuple[float, float]:
    """Fall of the corner, and the largest stress along the fillet, by triangles of second order of 1/32."""
    mesh = angle(32)
    X, cells = second_order(*mesh)
    load = load_of_end(X, cells, 3.0, -PULL)
    u = at_rest(quadratic_stiffness(X, cells, E, NU), np.repeat(X[:, 1:] < 3 - 1e-9, 2, axis=1), load)
    g, on = LinearElements(*mesh, E, NU), fillet(mesh.X)
    peak = 0.0
    for a, b in ((0, 1), (1, 2), (2, 0)):
        for e in np.flatnonzero(on[mesh.cells[:, a]] & on[mesh.cells[:, b]]):
            # in the middle of the side on the fillet
            L = np.bincount([a, b], minlength=3) / 2.0
            slope = np.zeros((6, 3))
            slope[range(3), range(3)] = 4.0 * L - 1.0
            for j, (c, d) in enumerate(((0, 1), (1, 2), (2, 0))):
                slope[3 + j, [c, d]] = 4.0 * L[d], 4.0 * L[c]
            H = np.einsum("ni,nk->ik", u[cells[e]], slope @ g.gradient[e])
            sigma = g.shear * (H + H.T) + g.lame * np.trace(H) * np.eye(2)
            T = np.diff(mesh.X[mesh.cells[e, [a, b]]], axis=0)[0]
            peak = max(peak, abs(T @ sigma @ T) / (T @ T))
    return float(u[np.argmin(np.hypot(X[:, 0] - 3, X[:, 1])), 1]), peak


def flag(m: int) -> Row:
    """Turek and Hron's CSM3, m spacings across the beam: vertical displacement of A, its mean -63.607 and amplitude
    65.160 mm, horizontal amplitude 14.305 mm, 1.0995 Hz. The linear elements have another law (neo-Hookean)."""

    def draw(occ: Any) -> None:
        occ.cut([(2, occ.addRectangle(0.2, 0.19, 0, 0.4, 0.02))], [(2, occ.addDisk(0.2, 0.2, 0, 0.05, 0.05))])
        occ.fragment([(2, 1)], [(0, occ.addPoint(0.6, 0.2, 0))])

    mesh, end, law = meshed(draw, 2, 0.02 / m), 2.2, {"youngs_modulus": 1.4e6, "poissons_ratio": 0.4}
    tables = scene(mesh, [{"kind": "fixed", "where": "round"}], end_time=end, loads={"acceleration": ["0", "-2"]})
    tables["regions"] = [{"name": "round", "formula": "hypot(X - 0.2, Y - 0.2) < 0.05 + 1e-9"}]
    tables["bodies"][0]["material"] = {"kind": "saint-venant-kirchhoff", "density": 1000.0, **law}
    tables["probes"] = [{"name": "A", "at": [0.6, 0.2], "fields": ["displacement"]}]
    tables["output"] = {"history_interval": 2e-3, "fields_times": [], "pictures": False}
    began = time.process_time()
    simulation = parsolid.Simulation(tables)
    history = HistoryOutput(simulation.core)
    simulation.core.run(None, [history])
    seconds = time.process_time() - began

    def errors(t: np.ndarray, v: np.ndarray) -> dict[str, float]:
        top = np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:])) + 1
        # the first return to rest, and the next one
        late = [float(np.interp(0.0, *_slope(t, v, i))) for i in top[v[top] > v.min() / 2] if t[i] > 0.2]
        found = {"mean": (v.max() + v.min()) / 2 / -0.063607 - 1, "amplitude": (v.max() - v.min()) / 2 / 0.065160 - 1}
        return found | {"frequency": len(late) / late[-1] / 1.0995 - 1}

    series = {
        key: np.array([row[key] for row in history.rows]) for key in ("time", "A.displacement_x", "A.displacement_y")
    }
    own = errors(series["time"], series["A.displacement_y"])
    own["horizontal"] = np.ptp(series["A.displacement_x"]) / 2 / 0.014305 - 1
    A = np.argmin(np.hypot(*(mesh.X - [0.6, 0.2]).T))
    began, times = time.process_time(), series["time"]
    elements = LinearElements(*mesh, *law.values())
    free = np.hypot(*(mesh.X - 0.2).T)[:, None] > 0.05 + 1e-9
    v = np.zeros_like(mesh.X)
    other = elements.motion(1000.0, v, free, times, 0.8, lambda u: float(u[A, 1]), np.array([0.0, -2.0]))["observed"]
    return Row(len(mesh.X), own, errors(times, other), (seconds, time.process_time() - began))


def _slope(t: np.ndarray, v: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Speeds around a maximum i, falling, and their times."""
    speed = np.diff(v[i - 1 : i + 2]) / np.diff(t[i - 1 : i + 2])
    return speed[::-1], 0.5 * (t[i - 1 : i + 1] + t[i : i + 2])[::-1]


def trapezium(m: int) -> Mesh:
    """Cook's membrane."""
    s, t = (one.ravel() for one in np.meshgrid(*[np.linspace(0, 1, m + 1)] * 2, indexing="ij"))
    X = np.stack([48 * s, 44 * s + t * (44 - 28 * s)], axis=1)
    first = (np.arange(m)[:, None] * (m + 1) + np.arange(m)).ravel()
    corners = [first, first + m + 1, first + m + 2, first + 1]
    cells = [np.stack([corners[i] for i in some], axis=1) for some in ((0, 1, 2), (0, 2, 3))]
    return Mesh(X, np.concatenate(cells))


@cache
def tip_of_second_order(nu: float) -> float:
    """The rise of Cook's tip by 64 x 64 squares halved of second order."""
    mesh = trapezium(64)
    X, cells = second_order(*mesh)
    load = load_of_end(X, cells, 48.0, PULL / 16)
    free = np.repeat((X[:, :1] > 1e-9), 2, axis=1)
    u = at_rest(quadratic_stiffness(X, cells, E, nu), free, load)
    return float(u[np.argmin(np.hypot(X[:, 0] - 48, X[:, 1] - 60)), 1])


def load_of_end(X: np.ndarray, cells: np.ndarray, end: float, traction: float) -> np.ndarray:
    """Loads (n, 2) of a vertical traction at x = end, by Simpson's rule on the edges."""
    load = np.zeros_like(X)
    for row in cells:
        for a, b, c in ((0, 1, 3), (1, 2, 4), (2, 0, 5)):
            if (X[row[[a, b]], 0] > end - 1e-9).all():
                length = abs(X[row[a], 1] - X[row[b], 1])
                load[row[[a, b, c]], 1] += traction * length * np.array([1, 1, 4]) / 6
    return load


REFERENCE = Path(__file__).parents[1] / "runs" / "tlsph" / "reference"
RUBBER = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}


def column(size: float, rate: float, kept: str, names: tuple[str, str, str], end: float) -> Row:
    """A clamped column that is turned, against spectral elements: largest errors over time."""
    mesh = meshed(lambda occ: occ.addBox(-0.5, 0, -0.5, 1, 6, 1), 3, size)
    tables = scene(mesh, [{"kind": "fixed", "plane": "Y = 0"}], end_time=end)
    tables["bodies"][0] |= {
        "material": RUBBER,
        "velocity": [f"{rate}*sin(pi*Y/12)*Z", "0", f"-{rate}*sin(pi*Y/12)*X"],
    }
    tables["probes"] = [{"name": "tip", "at": [0.5, 6, 0.5], "fields": ["twist"], "axis": "Y"}]
    tables["output"]["history_steps"] = 1
    exact = json.loads((REFERENCE / kept).read_text())
    began = time.process_time()
    simulation = parsolid.Simulation(tables)
    history = HistoryOutput(simulation.core)
    simulation.core.run(None, [history])
    seconds = time.process_time() - began
    run = {key: np.array([row[key] for row in history.rows]) for key in history.rows[0]}
    t = np.array(exact["t"])
    scale = exact["E0"], exact["E0"], np.abs(exact["series"][names[2]]).max()

    def errors(of: dict[str, np.ndarray], keys: tuple[str, str, str], times: np.ndarray) -> dict[str, float]:
        inside = times <= t[-1] * (1 + 1e-12)
        found = {}
        for label, key, name, largest in zip(("K", "W", "twist"), keys, names, scale):
            wanted = np.interp(times[inside], t, exact["series"][name])
            found[label] = np.abs(of[key][inside] - wanted).max() / largest
        return found

    own = errors(run, ("kinetic", "strain_energy", "tip.twist"), run["time"])
    own["balance"] = np.abs(run["energy_error"]).max() / run["kinetic"][0]
    x, y, z = mesh.X.T
    corner = np.argmin(np.linalg.norm(mesh.X - [0.5, 6, 0.5], axis=1))
    velocity = rate * np.sin(np.pi * y / 12)[:, None] * np.stack([z, 0 * y, -x], axis=1)

    def angle(u: np.ndarray) -> float:
        place = mesh.X[corner] + u[corner]
        return float(np.arctan2(place[0], place[2]) - np.pi / 4)

    began = time.process_time()
    elements = LinearElements(*mesh, RUBBER["youngs_modulus"], RUBBER["poissons_ratio"])
    other = elements.motion(RUBBER["density"], velocity, (y > 1e-9)[:, None], t[t <= end], 0.5, angle)
    other["observed"] = np.unwrap(other["observed"])
    return Row(
        len(mesh.X), own, errors(other, ("K", "W", "observed"), t[t <= end]), (seconds, time.process_time() - began)
    )


def torsion(m: int) -> Row:
    """Clamped column in small torsion, m spacings along a side of 1."""
    return column(1.0 / m, 0.1, "torsion.json", ("K", "W", "twist"), 0.25)


def twist(m: int) -> Row:
    """Clamped column in large torsion, m spacings along a side of 1."""
    return column(1.0 / m, 105.0, "twist.json", ("K", "W", "twist_C"), 0.25)


CASES: dict[str, tuple[Callable[[int], Row], tuple[int, ...]]] = {
    "hole": (hole, (6, 12, 24, 48)),
    "ellipse": (ellipse, (2, 3, 6, 12)),
    "cylinder": (cylinder, (4, 8, 16, 32)),
    "sphere": (sphere, (4, 6, 8, 12)),
    "bushing": (bushing, (4, 8, 16, 32)),
    "cook": (cook, (4, 8, 16, 32)),
    "soft-cook": (soft_cook, (4, 8, 16, 32)),
    "soft-torsion": (soft_torsion, (3, 4, 6, 8)),
    "bracket": (bracket, (4, 8, 16, 32)),
    "flag": (flag, (2, 4, 8)),
    "torsion": (torsion, (3, 4, 5, 6)),
    "twist": (twist, (3, 4, 5, 6)),
}


def main() -> None:
    """Print a table a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", choices=[*CASES, []])
    parser.add_argument("--meshes", type=int, default=4, help="how many of each case")
    words = parser.parse_args()
    for name in words.cases or CASES:
        case, sizes = CASES[name]
        print(f"{name}: {(case.__doc__ or '').strip()}")
        for size in sizes[: words.meshes]:
            row = case(size)
            own, other = (
                ", ".join(f"{key} {100 * value:+.2f} %" for key, value in values.items())
                for values in (row.own, row.elements)
            )
            print(f"  {row.nodes:6d} nodes  {own}  ({row.seconds[0]:.2f} s)")
            print(f"{'':16s}elements: {other}  ({row.seconds[1]:.2f} s)", flush=True)


if __name__ == "__main__":
    if MPI.COMM_WORLD.size == 1:
        main()
