"""Loops over the particles that conditions act on.

Vectors are (d, n or more) with a row for each component. Entries are components of particles: rows (k,), and parts
(p, 4) of entries from one number to before another along one axis, whose forces one reaction reports. sums
(reactions + 1, c): of each reaction impulse [N s], moment [N m s] about a point (about, (reactions + 1, d)) and work
[J]; what is not reported has the number after the last one.
"""

from parsolid.kernels import kernel, reduction


@kernel
def put(rows, parts, values, vectors):
    """Set entries of vectors to values (k,)."""
    for p in range(parts.shape[0]):
        component = vectors[parts[p, 2]]
        for e in range(parts[p, 0], parts[p, 1]):
            component[rows[e]] = values[e]


@kernel
def replace(rows, parts, values, vectors, before):
    """Set entries of vectors to values (k,), and fill before (k,) with what was there."""
    for p in range(parts.shape[0]):
        component = vectors[parts[p, 2]]
        for e in range(parts[p, 0], parts[p, 1]):
            before[e], component[rows[e]] = component[rows[e]], values[e]


@kernel
def add_modes(modes, table, factors, values):
    """Add modes times their factors to values (k,) of entries; modes (m, 4): entries from one number to before another,
    number of the factor, and where in the table the mode begins."""
    for m in range(modes.shape[0]):
        first, last, shift, factor = modes[m, 0], modes[m, 1], modes[m, 3] - modes[m, 0], factors[modes[m, 2]]
        for e in range(first, last):
            values[e] += factor * table[shift + e]


@kernel
def set_loads(rows, parts, first, last, values, constant, vectors):
    """Set the vectors of particles to the constant ones and values (k,) of the parts first .. last - 1 on them."""
    for p in range(first, last):
        c = parts[p, 2]
        for e in range(parts[p, 0], parts[p, 1]):
            vectors[c, rows[e]] = constant[c, rows[e]]
    for p in range(first, last):
        component = vectors[parts[p, 2]]
        for e in range(parts[p, 0], parts[p, 1]):
            component[rows[e]] += values[e]


@reduction
def add_impulses(c, rows, duration, forces, velocity, place, about, sums):
    """Add impulses of forces (k,) [N] over a duration [s] along axis c on particles to the sums of one reaction, None
    where nobody reports them; their work [J]."""
    moving, work = velocity[c], 0.0
    for i in range(rows.size):
        work += forces[i] * moving[rows[i]]
    work *= duration
    if sums is not None:
        d = about.size
        following, last = (c + 1) % d, (c + 2) % d
        first, second = place[following], place[last]
        total, of_first, of_second = 0.0, 0.0, 0.0
        for i in range(rows.size):
            total += forces[i]
            of_first += forces[i] * (first[rows[i]] - about[following])
            of_second += forces[i] * (second[rows[i]] - about[last])
        sums[c] += duration * total
        sums[-1] += work
        if d == 2:
            sums[2] += duration * (of_first if c == 1 else -of_first)
        else:
            sums[3 + following] += duration * of_second
            sums[3 + last] -= duration * of_first
    return work


@kernel
def observe_entries(moving, holding, rows, parts, duration, values, acting, velocity, place, about, sums):
    """Count impulses and works of forces on entries over a duration [s], but not of parts that nobody reports and that
    are none of the first ones, so many as `moving`; the work [J] of these.

    values (k,) [N]: the forces, filled for the first parts, so many as `holding`, with what holds these against all
    other forces on the parts of particles on this side of mirror planes. acting: these forces, None without such parts:
    internal, damping, share, interaction and external as in `methods.leapfrog.kick`.
    """
    total = 0.0
    for p in range(parts.shape[0]):
        first, last, c, one = parts[p, 0], parts[p, 1], parts[p, 2], parts[p, 3]
        reported = one < sums.shape[0] - 1
        if p >= moving and not reported:
            continue
        among, forces = rows[first:last], values[first:last]
        if acting is not None and p < holding:
            force, damping, share, interaction, external = acting
            resist(c, among, force, damping, share, interaction, external, forces)
        if reported:
            work = add_impulses(c, among, duration, forces, velocity, place, about[one], sums[one])
        else:
            work = add_impulses(c, among, duration, forces, velocity, place, about[one], None)
        total += work if p < moving else 0.0
    return total


@kernel
def resist(c, rows, force, damping, share, interaction, external, values):
    """Fill values (k,) [N] with what holds component c of particles against all forces on them."""
    for i in range(rows.size):
        a = rows[i]
        acting = force[c, a]
        if damping is not None:
            acting += damping[c, a]
        if share is not None:
            acting *= share[a]
        if interaction is not None:
            acting += interaction[c, a]
        if external is not None:
            acting += external[c, a]
        values[i] = -acting


@kernel
def end_motion(rows, parts, values, start, velocity, mass, share, place, about, sums):
    """Set the velocities of entries to values (k,), and count impulses and works that have changed them from start (k,)
    [m/s], which is used up; the work of all [J]."""
    total = 0.0
    for p in range(parts.shape[0]):
        first, last, c, one = parts[p, 0], parts[p, 1], parts[p, 2], parts[p, 3]
        among, impulses, behind = rows[first:last], start[first:last], 0.0
        component, after = velocity[c], values[first:last]
        for i in range(among.size):
            a = among[i]
            part = mass[a] if share is None else mass[a] * share[a]
            change = after[i] - impulses[i]
            component[a] = after[i]
            impulses[i] = part * change
            # they act on the mean of both velocities
            behind += 0.5 * part * change * change
        if one < sums.shape[0] - 1:
            total += add_impulses(c, among, 1.0, impulses, velocity, place, about[one], sums[one])
            sums[one, -1] -= behind
        else:
            total += add_impulses(c, among, 1.0, impulses, velocity, place, about[one], None)
        total -= behind
    return total


@kernel
def observe_forces(one, rows, duration, forces, velocity, place, about, sums):
    """Count impulses and works of forces (d, k) [N] over a duration [s] for one reaction."""
    for c in range(forces.shape[0]):
        add_impulses(c, rows, duration, forces[c], velocity, place, about[one], sums[one])


@kernel
def spring_forces(rows, stiffness, damping, areas, normals, place, start, velocity, forces):
    """Fill forces (d, k) [N] of springs [Pa/m] and dashpots [Pa s/m] on areas (k,) [m^2] from start (d, k) to rest;
    normals (k, d): along which alone they act, or None."""
    for c in range(forces.shape[0]):
        component, now, moving = forces[c], place[c], velocity[c]
        for i in range(rows.size):
            a = rows[i]
            component[i] = -areas[i] * (stiffness * (now[a] - start[c, i]) + damping * moving[a])
    if normals is not None:
        for i in range(rows.size):
            along = 0.0
            for c in range(forces.shape[0]):
                along += forces[c, i] * normals[i, c]
            for c in range(forces.shape[0]):
                forces[c, i] = along * normals[i, c]


@kernel
def deformed_areas(rows, F, vectors, areas):
    """Fill areas (d, k) [m^2] of particles with cof(F) A; F (d d or more, n); vectors A (k, d) [m^2]."""
    for i in range(rows.size):
        a = rows[i]
        if vectors.shape[1] == 2:
            x, y = vectors[i, 0], vectors[i, 1]
            areas[0, i] = F[3, a] * x - F[2, a] * y
            areas[1, i] = -F[1, a] * x + F[0, a] * y
        else:
            for c in range(3):
                j, k = (c + 1) % 3, (c + 2) % 3
                total = 0.0
                for e in range(3):
                    m, n = (e + 1) % 3, (e + 2) % 3
                    minor = F[3 * j + m, a] * F[3 * k + n, a] - F[3 * j + n, a] * F[3 * k + m, a]
                    total += minor * vectors[i, e]
                areas[c, i] = total
