"""Reference series of the twist of the column without viscosity to .25 s, by spectral elements: no line of the package.

    python runs/tlsph/reference/twist_by_elements.py series 4 3 > MESH-3.json
    python runs/tlsph/reference/twist_by_elements.py series 4 4 > MESH-4.json
    python runs/tlsph/reference/twist_by_elements.py kept MESH-3.json MESH-4.json > runs/tlsph/reference/twist.json
    python runs/tlsph/reference/twist_by_elements.py compare OTHER.json MESH-2.json MESH-3.json MESH-4.json

`series` takes the order and the elements along half a side, equal cubes with Gauss-Lobatto-Legendre nodes, then, if
given, which part of the usual step's length is taken. Galerkin's method with lumped mass, central differences in time,
nothing that dissipates. The motion keeps the column's fourfold symmetry, so that a quarter of it is meshed: where the
planes X = 0 and Z = 0 meet the other quarters, u(R X) = R u(X) for the quarter turn R. `kept` is the finer of two
meshes, and their difference the uncertainty; `compare` says how meshes, from coarse to fine, differ from one another
and from another series.
"""

import json
import sys
from pathlib import Path

import numpy as np
from spectral_elements import DENSITY, POISSONS_RATIO, YOUNGS_MODULUS, gauss_lobatto

SHEAR = YOUNGS_MODULUS / 2 / (1 + POISSONS_RATIO)
LAME = 2 * SHEAR * POISSONS_RATIO / (1 - 2 * POISSONS_RATIO)
SPEED = np.sqrt((LAME + 2 * SHEAR) / DENSITY)
LENGTH, HALF, RATE, END, SAMPLES = 6.0, 0.5, 105.0, 0.25, 100
# of the time that a pressure wave at rest takes between the closest nodes; the largest strain doubles its speed
STEP = 0.25
COLUMNS = ("K", "W", "twist_C")


def quarter_turn(values: np.ndarray) -> np.ndarray:
    """Of vectors (3, ...): (x, y, 0) becomes (0, y, x)."""
    return np.stack((-values[2], values[1], values[0]))


class Quarter:
    """Nodes and elements of 0 <= X, Z <= .5; the elements are the last index of all that they have."""

    def __init__(self, order: int, cells: int) -> None:
        nodes, weights, derivative = gauss_lobatto(order)
        side, n, counts = HALF / cells, order + 1, (cells, round(LENGTH / HALF * cells), cells)
        self.slope, self.order = derivative * 2.0 / side, order
        shape = [count * order + 1 for count in counts]
        number = np.arange(np.prod(shape)).reshape(shape)
        first = np.stack(np.meshgrid(*(np.arange(count) * order for count in counts), indexing="ij"), 0).reshape(3, -1)
        inside = np.indices((n, n, n))
        self.of_element = number[tuple(inside[..., None] + first[:, None, None, None])]
        lines = [np.append((side * (np.arange(c)[:, None] + (nodes[:-1] + 1) / 2)).ravel(), side * c) for c in counts]
        self.places = np.stack(np.meshgrid(*lines, indexing="ij"), 0).reshape(3, -1)
        self.weight = np.einsum("i,j,k->ijk", weights, weights, weights)[..., None] * (side / 2) ** 3
        self.own_mass = DENSITY * self.gathered(np.broadcast_to(self.weight, self.of_element.shape))
        # nodes of Z = 0 and those of X = 0 that they come to by a quarter turn; the axis is in both
        self.on_z, self.on_x = number[:, :, 0].ravel(), number[0].T.ravel()
        self.axis = number[0, :, 0]
        self.mass = self.own_mass.copy()
        self.mass[self.on_z] += self.own_mass[self.on_x]
        self.mass[self.axis] = self.own_mass[self.axis]
        self.mass[self.on_x] = self.mass[self.on_z]
        self.free = self.places[1] > 1e-9
        self.corner = int(number[-1, -1, -1])
        self.step = STEP * side * (nodes[1] - nodes[0]) / 2 / SPEED

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Sums at nodes of what elements have there."""
        return np.bincount(self.of_element.ravel(), np.ascontiguousarray(values).ravel(), self.places.shape[1])

    def along(self, axis: int, matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The matrix times values (3, n, n, n, elements) along an axis."""
        shape, n = values.shape, self.order + 1
        return (matrix @ values.reshape(3 * n**axis, n, -1)).reshape(shape)

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, float]:
        """Elastic forces (3, nodes) [N], those of the other quarters added; energy of the whole [J]."""
        local = u[:, self.of_element]
        F = np.stack([self.along(axis, self.slope, local) for axis in range(3)], axis=1)
        for i in range(3):
            F[i, i] += 1.0
        H = np.stack([np.cross(F[(i + 1) % 3], F[(i + 2) % 3], axis=0) for i in range(3)])
        J = (F[0] * H[0]).sum(axis=0)
        if not J.min() > 0.0:
            raise SystemExit(f"an element is turned inside out: J = {J.min():.3g}")
        density = 0.5 * SHEAR * ((F * F).sum((0, 1)) - 3.0 - 2.0 * np.log(J)) + 0.5 * LAME * (J - 1.0) ** 2
        energy = 4.0 * float((self.weight * density).sum())
        P = (SHEAR * F + (LAME * (J - 1.0) - SHEAR / J) * H) * self.weight
        pulled = sum(self.along(axis, self.slope.T, np.ascontiguousarray(P[:, axis])) for axis in range(3))
        return self.joined(-np.stack([self.gathered(one) for one in pulled])), energy

    def joined(self, force: np.ndarray) -> np.ndarray:
        """What the quarters beyond X = 0 and Z = 0 add; nothing across the axis."""
        on_axis = force[:, self.axis] * [[0.0], [1.0], [0.0]]
        other = force[:, self.on_x]
        force[:, self.on_z] += np.stack((other[2], other[1], -other[0]))
        force[:, self.on_x] = quarter_turn(force[:, self.on_z])
        force[:, self.axis] = on_axis
        return force


def series(order: int, cells: int, factor: float = 1.0) -> dict:
    """Energies and the corner's twist at equal times, and the most that their sum changed."""
    mesh = Quarter(order, cells)
    X, Y, Z = mesh.places
    rate = RATE * np.sin(np.pi * Y / (2 * LENGTH))
    v, u = np.stack((rate * Z, 0.0 * Y, -rate * X)) * mesh.free, np.zeros_like(mesh.places)
    between = int(np.ceil(END / SAMPLES / (factor * mesh.step)))
    dt, rows, angles = END / SAMPLES / between, [], []
    free = mesh.free / mesh.mass
    force, energy = mesh.forces(u)
    for step in range(SAMPLES * between + 1):
        if step % between == 0:
            corner = (mesh.places + u)[:, mesh.corner]
            angles.append(np.arctan2(corner[0], corner[2]))
            rows.append((step * dt, 2.0 * float((mesh.own_mass * v * v).sum()), energy))
        v += 0.5 * dt * free * force
        u += dt * v
        force, energy = mesh.forces(u)
        v += 0.5 * dt * free * force
    t, K, W = (np.array(column) for column in zip(*rows))
    found = dict(zip(COLUMNS, (K, W, np.unwrap(angles) - angles[0])))
    said = (
        "column of 1 x 6 x 1 m, held at Y = 0, velocity 105 sin(pi Y/12) rad/s x X, no viscosity; spectral elements "
        f"of order {order}, {cells} along half a side, {SAMPLES * between} steps"
    )
    where = {"method": "spectral elements", "case": "twist", "description": said, "E0": float(K[0])}
    drift = float(np.abs(K + W - K[0]).max() / K[0])
    columns = {name: [float(f"{x:.8g}") for x in values] for name, values in found.items()}
    # that the columns of the scene name
    columns["Dint"] = [0.0] * len(t)
    return {**where, "energy_drift": drift, "t": t.round(6).tolist(), "series": columns}


def apart(one: dict, other: dict) -> dict[str, float]:
    """Largest differences over time, over the energy at the start and the largest twist, at the first one's times."""
    found = {}
    for name in COLUMNS:
        values = np.array(one["series"][name])
        scale = np.abs(values).max() if name == "twist_C" else one["E0"]
        found[name] = float(np.abs(np.interp(one["t"], other["t"], other["series"][name]) - values).max() / scale)
    return found


def kept(coarse: dict, fine: dict) -> dict:
    """The series of reference; `uncertainty` over the energy at the start and the largest twist."""
    said = fine["description"] + "; uncertainty: what a coarser mesh differs by, over E0 and over the largest twist"
    return {**fine, "description": said, "uncertainty": {k: float(f"{x:.2g}") for k, x in apart(fine, coarse).items()}}


def compare(other: dict, meshes: list[dict]) -> None:
    for one, finer in zip(meshes, [*meshes[1:], None]):
        print(f"{one['description']}; energy changes by {one['energy_drift']:.1e}")
        print("    from the other series:", ", ".join(f"{k} {100 * x:.3f} %" for k, x in apart(one, other).items()))
        if finer:
            print("    from the next mesh:", ", ".join(f"{k} {100 * x:.3f} %" for k, x in apart(finer, one).items()))


if __name__ == "__main__":
    task, *rest = sys.argv[1:]
    if task == "series":
        print(json.dumps(series(int(rest[0]), int(rest[1]), *map(float, rest[2:]))))
    else:
        first, *others = [json.loads(Path(name).read_text()) for name in rest]
        print(json.dumps(kept(first, others[0]))) if task == "kept" else compare(first, others)
