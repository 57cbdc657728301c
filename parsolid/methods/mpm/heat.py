"""Heat conduction on the background grid: lumped capacities, particle temperatures changed by the increments of the
nodes.

    C_i = sum_p w_ip C_p    T_i = sum_p w_ip C_p T_p / C_i    Q_i = sum_p [w_ip q_p - V_p kappa (grad T)_p . grad w_ip]
    T_p <- T_p + dt sum_i w_ip Q_i / C_i

so that sum_p C_p T_p changes by the powers q_p alone. A transfer of temperatures instead of increments would smooth
them at every step, whatever the spacing.

    thermal (capacity, 4)  T [K], C = m c [J/K], V kappa [W m/K], q [W]     of a particle
    nodes   (nodes, 8)     C T, C, 0, 0 | Q, 0, 0, 0                        after `scatter_heat` and `conduct`
                           T, C, 0, 0 | change of T, 0, 0, 0                after `find_temperatures` and
                           `find_increments`
"""

import math

from decomposition.compiled import compiled
from parsolid.materials.plastic.specific_heat import specific_heat, temperature_rise
from parsolid.methods.mpm.gather import sum_nodes
from parsolid.methods.mpm.grid import clear_cell, weigh
from parsolid.methods.mpm.layout import store_stress
from parsolid.methods.mpm.scatter import add_particle
from parsolid.methods.mpm.weights import base_offset, store_distances, store_weights
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import WIDTH, broadcast, from_floats, fused, lane, load, store
from parsolid.numerics.layout import Plane, four_rows
from parsolid.numerics.polar import congruence, rotation
from parsolid.numerics.tensor_rows import load_general, one_gradient
from parsolid.numerics.tensors import SymmetricPlane, SymmetricSpace, cofactor, determinant


@compiled(fastmath={"contract"}, error_model="numpy")
def scatter_heat(interpolation, thermal, slopes, nodes, partials):
    """Add C T and C of the particles of all cells to nodes; arguments as in `scatter.scatter`.

    slopes (capacity, 4) [K/m]: those of the particles' temperatures, with which they count at the nodes, or None.
    """
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    for c in range(len(grid.start) - 1):
        if grid.start[c] == grid.start[c + 1]:
            continue
        cell = scratch.cell if partials is None else partials[c]
        clear_cell(cell)
        base = load(grid.base, c, 0)
        for n in range(grid.start[c], grid.start[c + 1]):
            p = grid.order[n]
            _, xi = weigh(interpolation, base, p)
            heat = from_floats(thermal[p, 0] * thermal[p, 1], thermal[p, 1], 0.0, 0.0)
            inclined = _inclined(slopes, p, basis, xi, scratch.weights, thermal[p, 1] * grid.spacing)
            add_particle(space, basis, scratch.weights, cell, heat, inclined, None, None)
        if partials is None:
            for k in range(cell.shape[0]):
                node = grid.stencil[c, k]
                store(nodes, node, 0, load(nodes, node, 0) + load(cell, k, 0))


@none_without("slopes")
def _inclined(slopes, p, basis, xi, weights, scale):
    """Columns of C h grad T, for which node distances are stored."""
    store_distances(basis, xi, weights)
    return (
        from_floats(scale * slopes[p, 0], 0.0, 0.0, 0.0),
        from_floats(scale * slopes[p, 1], 0.0, 0.0, 0.0),
        from_floats(scale * slopes[p, 2], 0.0, 0.0, 0.0),
    )


@compiled(error_model="numpy")
def find_temperatures(first, last, nodes):
    """Nodal temperatures from C T and C; 0 where there is no capacity. Columns 4..7 become 0."""
    for i in range(first, last):
        capacity = nodes[i, 1]
        nodes[i, 0] = nodes[i, 0] / capacity if capacity > 0.0 else 0.0
        store(nodes, i, 4, broadcast(0.0))


@compiled(fastmath={"contract"}, error_model="numpy")
def conduct(interpolation, deformation, thermal, tensors, slopes, nodes, partials):
    """Add the heat flows and powers of the particles of all cells to column 4 of nodes, from their temperatures.

    Arguments as in `scatter.scatter`; deformation: rows of F (5 or 9, capacity) where the weights are those of
    reference positions, else None; tensors (capacity, 8): V kappa [W m/K] as rows of a `CauchyStress`, in the place of
    that in thermal, or None; slopes (capacity, 4) [K/m] become the gradients there, or None. With partials,
    columns 4..7 of a cell's are its sums and 0..3 are 0.
    """
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    for c in range(len(grid.start) - 1):
        if grid.start[c] == grid.start[c + 1]:
            continue
        cell = scratch.cell
        for k in range(cell.shape[0]):
            store(cell, k, 0, load(nodes, grid.stencil[c, k], 0))
            store(cell, k, 4, broadcast(0.0))
        base = load(grid.base, c, 0)
        for n in range(grid.start[c], grid.start[c + 1]):
            p = grid.order[n]
            weigh(interpolation, base, p)
            gradient = sum_nodes(space, basis, scratch, None, thermal, None)[2]
            if slopes is not None:
                for d in range(3):
                    slopes[p, d] = grid.inverse_spacing * lane(gradient[d], 0)
            # the weights' derivatives are by x/h, here and in the gradient
            scale = -grid.inverse_spacing * grid.inverse_spacing
            by_place = (lane(gradient[0], 0), lane(gradient[1], 0), lane(gradient[2], 0))
            flow = _conducted(tensors, thermal, p, _referred(space, deformation, p, by_place))
            columns = (
                from_floats(scale * flow[0], 0.0, 0.0, 0.0),
                from_floats(scale * flow[1], 0.0, 0.0, 0.0),
                from_floats(scale * flow[2], 0.0, 0.0, 0.0),
            )
            power = from_floats(thermal[p, 3], 0.0, 0.0, 0.0)
            add_particle(space, basis, scratch.weights, cell, None, None, columns, power)
        for k in range(cell.shape[0]):
            if partials is None:
                node = grid.stencil[c, k]
                store(nodes, node, 4, load(nodes, node, 4) + load(cell, k, 4))
            else:
                store(partials[c], k, 0, broadcast(0.0))
                store(partials[c], k, 4, load(cell, k, 4))


@compiled(fastmath={"contract"}, error_model="numpy")
def supply_at_faces(interpolation, feet, power, nodes, partials):
    """Add powers (capacity,) [W] to column 4 of nodes, by the weights of the places feet (capacity, 4) [m]; after
    `conduct`.

    A place beyond the cell of its particle counts as at the edge of it.
    """
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    first = broadcast(base_offset(basis))
    for c in range(len(grid.start) - 1):
        cell, any_power = scratch.cell, False
        clear_cell(cell)
        for n in range(grid.start[c], grid.start[c + 1]):
            p = grid.order[n]
            if power[p] != 0.0:
                any_power = True
                apart = load(feet, p, 0) - load(grid.origin, 0, 0)
                xi = fused(apart, broadcast(grid.inverse_spacing), -load(grid.base, c, 0))
                store_weights(basis, p, min(max(xi, first), first + 1.0), scratch.weights)
                heat = from_floats(power[p], 0.0, 0.0, 0.0)
                add_particle(space, basis, scratch.weights, cell, heat, None, None, None)
        for k in range(cell.shape[0] if any_power else 0):
            if partials is None:
                nodes[grid.stencil[c, k], 4] += cell[k, 0]
            else:
                partials[c, k, 4] += cell[k, 0]


@generic(on="tensors")
def _conducted(tensors, thermal, p, g):
    """V kappa . g."""


@_conducted.of(None)
def _alike(tensors, thermal, p, g):
    return thermal[p, 2] * g[0], thermal[p, 2] * g[1], thermal[p, 2] * g[2]


@_conducted.otherwise
def _by_direction(tensors, thermal, p, g):
    xx, yy, zz, yz, xz, xy = tensors[p, 0], tensors[p, 1], tensors[p, 2], tensors[p, 4], tensors[p, 5], tensors[p, 6]
    return xx * g[0] + xy * g[1] + xz * g[2], xy * g[0] + yy * g[1] + yz * g[2], xz * g[0] + yz * g[1] + zz * g[2]


@compiled(fastmath={"contract"}, error_model="numpy")
def turn_conductivities(first, last, space, components, deformation, motion, tensors):
    """V R kappa R^T [W m/K] of particles first..last-1 of one law, R the rotation of F, as records xx yy zz 0 | yz xz
    xy 0.

    components [W/(m K)]: xx yy zz xy xz yz; deformation, motion as in `fill_thermal`. Up to three rows beyond `last`
    are overwritten.
    """
    for i in range(first, last, WIDTH):
        F = load_general(space, deformation, i)
        volume = determinant(F) * four_rows(motion, i, 4)[3]
        turned = congruence(rotation(F), _of_components(space, components))
        store_stress(space, tensors, i, volume * turned, broadcast(0.0))


@generic
def _of_components(space, components):
    """A symmetric tensor that is the same for four particles."""


@_of_components.of(Plane)
def _plane_components(space, components):
    xx, yy, zz, xy = components[0], components[1], components[2], components[3]
    return SymmetricPlane(broadcast(xx), broadcast(yy), broadcast(zz), broadcast(xy))


@_of_components.otherwise
def _space_components(space, components):
    xx, yy, zz = broadcast(components[0]), broadcast(components[1]), broadcast(components[2])
    return SymmetricSpace(xx, yy, zz, broadcast(components[3]), broadcast(components[4]), broadcast(components[5]))


@generic(on="deformation")
def _referred(space, deformation, p, g):
    """F^-1 F^-T g of a gradient by reference place; g where deformation is None."""


@_referred.of(None)
def _as_it_is(space, deformation, p, g):
    return g


@_referred.otherwise
def _pulled_back(space, deformation, p, g):
    F = one_gradient(space, deformation, p)
    C, scale = cofactor(F), 1.0 / determinant(F)
    a = scale * (C[0] * g[0] + C[1] * g[1] + C[2] * g[2])
    b = scale * (C[3] * g[0] + C[4] * g[1] + C[5] * g[2])
    c = scale * (C[6] * g[0] + C[7] * g[1] + C[8] * g[2])
    return (
        scale * (C[0] * a + C[3] * b + C[6] * c),
        scale * (C[1] * a + C[4] * b + C[7] * c),
        scale * (C[2] * a + C[5] * b + C[8] * c),
    )


@compiled(error_model="numpy")
def find_increments(first, last, nodes, step):
    """Changes of the nodal temperatures in a step [K] from the heat flows."""
    for i in range(first, last):
        nodes[i, 4] = step * nodes[i, 4] / nodes[i, 1] if nodes[i, 1] > 0.0 else 0.0


@compiled(fastmath={"contract"}, error_model="numpy")
def gather_heat(interpolation, nodes, thermal):
    """Add the nodal increments to the temperatures of the particles of all cells; the heat that they gained [J]."""
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    gained = 0.0
    for c in range(len(grid.start) - 1):
        for k in range(grid.stencil.shape[1]):
            store(scratch.cell, k, 4, load(nodes, grid.stencil[c, k], 4))
        base = load(grid.base, c, 0)
        for n in range(grid.start[c], grid.start[c + 1]):
            p = grid.order[n]
            weigh(interpolation, base, p)
            change = lane(sum_nodes(space, basis, scratch, None, None, nodes)[1], 0)
            thermal[p, 0] += change
            gained += thermal[p, 1] * change
    return gained


@compiled
def fold_capacity(ghost, image, sign, lift, nodes):
    """Add what the mirror image of the body gives to C T and C at a mirror plane; before `find_temperatures`.

    ghost, image: as in `grid.fold_mirror`. The image has the temperatures sign T + lift, lift (n,) [K]: at a plane at a
    temperature T0 2 T0 - T, at an insulated one T, where heat enters T less 2 d q/kappa at a depth d.
    """
    for k in range(ghost.size):
        here, there = ghost[k], image[k]
        nodes[there, 0] += sign * nodes[here, 0] + lift[k] * nodes[here, 1]
        nodes[there, 1] += nodes[here, 1]


@compiled
def spread_temperature(ghost, image, sign, lift, nodes):
    """Temperatures behind a mirror plane, of which `fold_capacity` takes the image; after `find_temperatures`."""
    for k in range(ghost.size):
        nodes[ghost[k], 0] = sign * (nodes[image[k], 0] - lift[k])


@compiled
def fold_flow(ghost, image, sign, nodes):
    """Add the image's heat flows; after `conduct`, before `find_increments`."""
    for k in range(ghost.size):
        nodes[image[k], 4] += sign * nodes[ghost[k], 4]


@compiled
def spread_increment(ghost, image, sign, change, nodes):
    """Increments behind and on a mirror plane whose temperature changes by (n,) [K] in the step; after
    `find_increments`.
    """
    for k in range(ghost.size):
        here, there = ghost[k], image[k]
        if here != there:
            nodes[here, 4] = sign * nodes[there, 4] + (1.0 - sign) * change[k]
        elif sign < 0.0:
            nodes[here, 4] = change[k]


@compiled(error_model="numpy")
def fill_thermal(first, last, space, law, conductivity, deformation, temperature, motion, thermal):
    """T, C and V kappa of particles first..last-1 of one law, in the present configuration; q becomes 0.

    conductivity [W/(m K)] of the law, or 0; deformation: 5 rows of F in two dimensions or 9 in three;
    temperature (1, capacity). Gives the largest diffusivity V kappa / C [m2/s].
    """
    largest = 0.0
    for p in range(first, last):
        J = determinant(one_gradient(space, deformation, p))
        thermal[p, 0], thermal[p, 1] = temperature[0, p], specific_heat(law, temperature[0, p]) * motion[p, 3]
        thermal[p, 2], thermal[p, 3] = conductivity * J * motion[p, 7], 0.0
        largest = max(largest, thermal[p, 2] / thermal[p, 1])
    return largest


@compiled(error_model="numpy")
def hand_over_rise(first, last, thermal, rise, step, spacing):
    """Make a share of the rises (1, capacity) [K] of particles first..last-1 powers of a step [s] instead; its heat
    [J].

    Differences within a cell die away by exp(-pi^2 alpha t / h^2), as the shortest waves of the grid do; spacing h [m].
    """
    heat, decay = 0.0, (math.pi / spacing) ** 2 * step
    for p in range(first, last):
        passed = rise[0, p] * -math.expm1(-decay * thermal[p, 2] / thermal[p, 1])
        thermal[p, 0] -= passed
        thermal[p, 3] += thermal[p, 1] * passed / step
        heat += thermal[p, 1] * passed
        rise[0, p] -= passed
    return heat


@compiled(error_model="numpy")
def take_heat(first, last, law, thermal, motion, temperature, energy):
    """New temperatures of particles first..last-1, and their heat as internal energy, (1, capacity) [J/m3]."""
    for p in range(first, last):
        heat = thermal[p, 1] * (thermal[p, 0] - temperature[0, p]) / motion[p, 7]
        energy[0, p] += heat
        if law.specific_heat_slope == 0.0:
            temperature[0, p] = thermal[p, 0]
        else:
            temperature[0, p] += temperature_rise(law, thermal[p, 1] / motion[p, 7], heat)
