"""The bracket of docs/bracket.md by finite elements of first and second order, small strain, at rest:
python benchmarks/bracket_elements.py SIZE ORDER, the size of edges in mm. Prints vertices and the end's deflection."""

import sys
from pathlib import Path

import gmsh
import numpy as np
from linear_elements import assembled, at_rest, element_matrices

MODULUS, RATIO, TRACTION, END = 2e9, 0.39, 1e5, 0.06
STEP = Path(__file__).parents[1] / "runs" / "tlsph" / "meshes" / "bracket.step"
# Gmsh's kinds of tetrahedra and of triangles, their vertices, points of quadrature, and the parts of a uniform traction
KINDS = {1: (4, 4, "Gauss1", 2, [1 / 3, 1 / 3, 1 / 3]), 2: (11, 10, "Gauss2", 9, [0, 0, 0, 1 / 3, 1 / 3, 1 / 3])}


def mesh_of(size: float, order: int):
    """Places (n, 3) [m], elements, gradients (points, vertices, 3), weights (points,), triangles."""
    gmsh.initialize(readConfigFiles=False)
    options = {
        "General.Terminal": 0,
        "General.NumThreads": 1,
        "Mesh.OptimizeNetgen": 1,
        "Mesh.MeshSizeFromCurvature": 12,
    }
    for key, value in (options | {"Mesh.MeshSizeMax": size, "Mesh.MeshSizeMin": 0.25 * size}).items():
        gmsh.option.setNumber(key, value)
    gmsh.merge(str(STEP))
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    tags, places, _ = gmsh.model.mesh.getNodes()
    solid, count, rule, face, parts = KINDS[order]
    found = np.sort(tags)
    cells = np.searchsorted(found, gmsh.model.mesh.getElementsByType(solid)[1]).reshape(-1, count)
    triangles = np.searchsorted(found, gmsh.model.mesh.getElementsByType(face)[1]).reshape(-1, len(parts))
    points, weights = gmsh.model.mesh.getIntegrationPoints(solid, rule)
    gradients = gmsh.model.mesh.getBasisFunctions(solid, points, "GradLagrange")[1].reshape(len(weights), -1, 3)
    gmsh.finalize()
    return 1e-3 * places.reshape(-1, 3)[np.argsort(tags)], cells, gradients, weights, triangles


def stiffness(X, cells, gradients, weights):
    """The matrix (3 n, 3 n) [N/m]."""
    shear, lame = MODULUS / (2 + 2 * RATIO), MODULUS * RATIO / ((1 + RATIO) * (1 - 2 * RATIO))
    K = 0.0
    for dN, weight in zip(gradients, weights):
        J = np.einsum("eni,nk->eik", X[cells], dN)
        grad = np.einsum("nk,eki->eni", dN, np.linalg.inv(J))
        K = K + element_matrices(grad, weight * np.abs(np.linalg.det(J)), shear, lame)
    return assembled(K, cells, len(X))


def main(size: float, order: int) -> None:
    """Solve and print."""
    X, cells, gradients, weights, triangles = mesh_of(size, order)
    force, at_end = np.zeros_like(X), triangles[(np.abs(X[triangles, 0] - END) < 1e-9).all(axis=1)]
    a, b, c = (X[at_end[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    for column, part in zip(at_end.T, KINDS[order][4]):
        np.add.at(force[:, 2], column, -TRACTION * area * part)
    used = np.isin(np.arange(len(X)), cells)
    free = np.repeat((used & (np.abs(X[:, 0]) > 1e-9))[:, None], 3, axis=1)
    u = at_rest(stiffness(X, cells, gradients, weights), free, force)
    end = used & (np.abs(X[:, 0] - END) < 1e-9)
    print(f"{used.sum()} vertices: the end sinks by {-1e3 * u[end, 2].mean():.4f} mm")


if __name__ == "__main__":
    main(float(sys.argv[1]), int(sys.argv[2]))
