"""The background grid of the material point method: arrays, node update, mirror planes, rigid walls.

Only nodes near particles exist; they are numbered by slots in any order. Particles are listed by base cell (`weights`);
passes are fast where the list is nearly in the order of storage.

    motion  (capacity, 8)  x y z m | vx vy vz V0    a particle's position [m], mass [kg], velocity [m/s], reference
    volume [m3]
    nodes   (nodes, 8)     px py pz m | fx fy fz 0  after a scatter: momentum [kg m/s], mass, force [N]
                           vx vy vz m | ax ay az 0  after `update_nodes`: new velocity [m/s], and its change in the step
                           [m/s]

In two dimensions z = 0; in plane strain masses and volumes are those of a metre of thickness, in axisymmetry of a
radian, with x = r and y along the axis.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.methods.mpm.weights import nodes_across, store_weights
from parsolid.numerics.lanes import aligned_zeros, broadcast, fused, load, store, swizzle

_mass = swizzle(3, 3, 3, 3)


class Grid(NamedTuple):
    """Base cells with their particles and nodes.

    origin (4,) [m]: a node; spacing [m] and its inverse; base (cells, 4): base nodes' indices as floats, unused columns
    0; start (cells + 1,), order (capacity,) int64: particles order[start[c]]..order[start[c+1]-1] lie in cell c;
    stencil (cells, K**dimension) int32: node slots, the last direction fastest.
    """

    origin: np.ndarray
    spacing: float
    inverse_spacing: float
    base: np.ndarray
    start: np.ndarray
    order: np.ndarray
    stencil: np.ndarray


class Scratch(NamedTuple):
    """Working arrays of the passes: weights (K, 16) of one particle, cell (K**dimension, 8) nodes of one cell."""

    weights: np.ndarray
    cell: np.ndarray


def make_scratch(basis, dimension: int) -> Scratch:
    """Working arrays for a basis in 2 or 3 dimensions."""
    across = nodes_across(basis)
    return Scratch(aligned_zeros((across, 16)), aligned_zeros((across**dimension, 8)))


class Interpolation(NamedTuple):
    """How particles and nodes see one another.

    space: Plane, Axisymmetric or Space; basis: one of `weights`; places (capacity, >= 4): positions [m] that the
    weights belong to, the fourth column unused.
    """

    space: Any
    basis: Any
    grid: Grid
    scratch: Scratch
    places: np.ndarray


@register_jitable
def weigh(interpolation, base, p):
    """Place of particle p [m] and that from its base node in spacings; its weights are left in the scratch."""
    grid = interpolation.grid
    place = load(interpolation.places, p, 0)
    xi = fused(place - load(grid.origin, 0, 0), broadcast(grid.inverse_spacing), -base)
    store_weights(interpolation.basis, p, xi, interpolation.scratch.weights)
    return place, xi


@register_jitable
def clear_cell(cell):
    """Zeros for the sums of a cell."""
    for k in range(cell.shape[0]):
        store(cell, k, 0, broadcast(0.0))
        store(cell, k, 4, broadcast(0.0))


class Flip(NamedTuple):
    """Particles add the change of the nodal velocity; `fraction` below 1 blends in the nodal velocity itself.

    Brackbill, Kothe and Ruppel, Comput. Phys. Commun. 48 (1988) 25.
    """

    fraction: float


class Apic(NamedTuple):
    """Particles take the nodal velocity and its slope. affine (capacity, 12): rows of the slope [1/s], each padded to
    4.

    Jiang et al., ACM Trans. Graph. 34 (2015) 51.
    """

    affine: np.ndarray


class AffineFlip(NamedTuple):
    """Particles add the change of the nodal velocity as with `Flip` and give its slope with their momentum as with
    `Apic`, of which affine is the array.

    Fei et al., ACM Trans. Graph. 40 (2021) 109 (AFLIP).
    """

    affine: np.ndarray
    fraction: float


class Taylor(NamedTuple):
    """As `Apic`, with the gradient of the nodal velocity in the place of the slope that fits its moments.

    Nakamura, Matsumura and Mizutani, Comput. Methods Appl. Mech. Engrg. 403 (2023) 115720 (TPIC).
    """

    affine: np.ndarray


class CauchyStress(NamedTuple):
    """rows (capacity, 8): V sigma [N m] of the current volume, xx yy zz 0 | yz xz xy and a number that is not read."""

    rows: np.ndarray


class FirstPiolaKirchhoffStress(NamedTuple):
    """rows (capacity, 12): V0 P [N m], rows of the tensor, each padded to 4 with 0."""

    rows: np.ndarray


class RigidWall(NamedTuple):
    """Nodes at or behind a moving plane follow it: point (4,) [m], normal (4,) into the body, velocity (4,) [m/s],
    fourth 0.

    sticking 1.0: they take the wall's velocity; 0.0: they may slide, and leave in the direction of the normal.
    """

    point: np.ndarray
    normal: np.ndarray
    velocity: np.ndarray
    sticking: float


@compiled
def fold_mirror(ghost, image, signs, nodes):
    """Add what the mirror image of the body gives to the nodes before a mirror plane; before `update_nodes`.

    ghost, image (n,) int32: slots of the nodes on and behind the plane, and of their mirror images (a node on the plane
    is its own); signs (1, 8): of each column of nodes, -1 for the momentum and force that the mirror reverses. Exact
    for every basis when the plane lies on nodes or halfway between. Where planes meet, fold them one after the other.
    """
    first, second = load(signs, 0, 0), load(signs, 0, 4)
    for k in range(ghost.size):
        here, there = ghost[k], image[k]
        store(nodes, there, 0, fused(first, load(nodes, here, 0), load(nodes, there, 0)))
        store(nodes, there, 4, fused(second, load(nodes, here, 4), load(nodes, there, 4)))


@compiled
def spread_mirror(ghost, image, signs, nodes):
    """Give the nodes behind a mirror plane the reflected values of their images; after `update_nodes`, planes in
    reverse order.
    """
    first, second = load(signs, 0, 0), load(signs, 0, 4)
    for k in range(ghost.size):
        here, there = ghost[k], image[k]
        store(nodes, here, 0, first * load(nodes, there, 0))
        store(nodes, here, 4, second * load(nodes, there, 4))


@compiled(error_model="numpy")
def update_nodes(first, last, nodes, step, gravity, least_mass):
    """Nodal velocities from momentum, force and gravity (4,) [m/s2, fourth 0]; nodes lighter than least_mass [kg] stand
    still.
    """
    g = step * load(gravity, 0, 0)
    for i in range(first, last):
        p = load(nodes, i, 0)
        mass = nodes[i, 3]
        if mass > least_mass:
            change = fused(load(nodes, i, 4), broadcast(step / mass), g)
            velocity = fused(p, broadcast(1.0 / mass), change)
            store(nodes, i, 0, velocity)
            store(nodes, i, 4, change)
            nodes[i, 3] = mass
        else:
            store(nodes, i, 0, broadcast(0.0))
            store(nodes, i, 4, broadcast(0.0))


@compiled(error_model="numpy")
def find_velocities(first, last, nodes, least_mass):
    """Nodal velocities from momentum alone, as when momentum is mapped back to the grid (MUSL); columns
    4..7 become 0.
    """
    for i in range(first, last):
        mass = nodes[i, 3]
        scale = 1.0 / mass if mass > least_mass else 0.0
        store(nodes, i, 0, broadcast(scale) * load(nodes, i, 0))
        store(nodes, i, 4, broadcast(0.0))
        nodes[i, 3] = mass


@compiled
def obey_wall(first, last, nodes, places, share, held, motion, remapped, wall):
    """Let nodes at or behind a rigid wall move with it; after `update_nodes`. Gives the impulse [N s] on the body and a
    loss [J].

    places (nodes, 4): positions [m]; share (nodes,): what counts of a node, see `kinetic_gain`. The wall's work on the
    body is impulse . wall.velocity. Lost is m/2 of the square of what the whole step changes in the velocity that the
    wall sets: all of it when a body is caught, nothing while it stays.

    held (nodes,) bool: which nodes the wall holds in the step, found unless `nodes` are of remapped momentum (MUSL).
    Those obey where it is True, motion (nodes, 8) being `nodes` of the motion: matter that strained with nodes free to
    leave, which in the motion are held, would gain energy from the wall. Lost is then what the particles kept
    of the held nodes' velocity.
    """
    impulse, lost = np.zeros(3), 0.0
    for i in range(first, last):
        distance, speed = 0.0, 0.0
        for d in range(3):
            distance += wall.normal[d] * (places[i, d] - wall.point[d])
            speed += wall.normal[d] * (nodes[i, d] - wall.velocity[d])
        if not remapped:
            held[i] = distance <= 0.0 < nodes[i, 3] and (wall.sticking != 0.0 or speed < 0.0)
        if not held[i]:
            continue
        caught, along, kept = 0.0, 0.0, 0.0
        for d in range(3):
            change = -speed * wall.normal[d]
            if wall.sticking != 0.0:
                change = wall.velocity[d] - nodes[i, d]
            nodes[i, d] += change
            nodes[i, 4 + d] += change
            impulse[d] += share[i] * nodes[i, 3] * change
            caught += nodes[i, 4 + d] ** 2
            along += wall.normal[d] * nodes[i, 4 + d]
            kept += change * motion[i, 4 + d]
        if not remapped:
            kept = caught if wall.sticking != 0.0 else along**2
        lost += 0.5 * share[i] * nodes[i, 3] * kept
    return impulse[0], impulse[1], impulse[2], lost


@compiled
def kinetic_gain(first, last, nodes, share):
    """Change of the nodes' kinetic energy [J] in a step; after `update_nodes` and walls.

    share (nodes,): 1, but 0 for nodes behind mirror planes and 1/2 on each mirror plane; of nodes that other ranks
    list as well the part of their mass that this rank's particles give.
    """
    gain = 0.0
    for i in range(first, last):
        power = 0.0
        for d in range(3):
            power += nodes[i, 4 + d] * (nodes[i, d] - 0.5 * nodes[i, 4 + d])
        gain += share[i] * nodes[i, 3] * power
    return gain


@compiled
def energy_of_changes(first, last, nodes, share):
    """sum_i m_i a_i^2 / 2 [J] of the nodes' changes of velocity in a step; share as in `kinetic_gain`."""
    energy = 0.0
    for i in range(first, last):
        square = nodes[i, 4] ** 2 + nodes[i, 5] ** 2 + nodes[i, 6] ** 2
        energy += share[i] * nodes[i, 3] * square
    return 0.5 * energy


@compiled
def energy_of_particle_changes(before, motion):
    """sum_p m_p (v_p - v_p before)^2 / 2 [J] of the particles in before (n, 8)."""
    energy = 0.0
    for p in range(len(before)):
        square = 0.0
        for d in range(4, 7):
            square += (motion[p, d] - before[p, d]) ** 2
        energy += motion[p, 3] * square
    return 0.5 * energy


@compiled
def kinetic_energy(owned, motion):
    """Sum of m v^2/2 [J] of particles."""
    energy = 0.0
    for p in range(owned):
        energy += motion[p, 3] * (motion[p, 4] ** 2 + motion[p, 5] ** 2 + motion[p, 6] ** 2)
    return 0.5 * energy
