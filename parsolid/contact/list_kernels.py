"""Kernels that make lists of contact, sum colours of the reference, and carry values between particles and entries."""

import math

import numpy as np

from parsolid.contact.kernel import shape
from parsolid.kernels import kernel


@kernel
def directed(start, neighbour, owned, outer, ghost, side, reverse, particle):
    """Both directions of pairs of owned entries and those with ghosts, of sides that face each other: starts,
    neighbours; particle (n,): whose entry it is, never its own neighbour."""
    count = np.zeros(owned + 1, np.int64)
    result = np.empty(0, np.int32)
    at = np.zeros(owned, np.int64)
    for turn in range(2):
        if turn:
            for a in range(owned):
                count[a + 1] += count[a]
                at[a] = count[a]
            result = np.empty(count[owned], np.int32)
        for a in range(owned):
            for k in range(start[a], start[a + 1]):
                b = neighbour[k]
                if side[b] == reverse[side[a]] and particle[a] != particle[b]:
                    if turn:
                        result[at[a]], result[at[b]] = b, a
                        at[a] += 1
                        at[b] += 1
                    else:
                        count[a + 1] += 1
                        count[b + 1] += 1
            for k in range(outer[a], outer[a + 1]):
                b = ghost[k]
                if side[b] == reverse[side[a]] and particle[a] != particle[b]:
                    if turn:
                        result[at[a]] = b
                        at[a] += 1
                    else:
                        count[a + 1] += 1
    return count, result


@kernel
def sort_rows(start, neighbour, code, key):
    """Order each row by the neighbours' keys, then by the codes of their images."""
    for a in range(len(start) - 1):
        for k in range(start[a] + 1, start[a + 1]):
            b, c = neighbour[k], code[k]
            m = k
            while m > start[a] and (
                key[neighbour[m - 1]] > key[b] or (key[neighbour[m - 1]] == key[b] and code[m - 1] > c)
            ):
                neighbour[m], code[m] = neighbour[m - 1], code[m - 1]
                m -= 1
            neighbour[m], code[m] = b, c


@kernel
def add_colours(place, volume, start, neighbour, owned, inverse, total):
    """Add V_b shape(|X_a - X_b|/R) to both ends of pairs, to the owned ends of those with ghosts."""
    for a in range(len(start) - 1):
        for k in range(start[a], start[a + 1]):
            b, square = neighbour[k], 0.0
            for i in range(place.shape[1]):
                square += (place[a, i] - place[b, i]) ** 2
            w = shape(np.sqrt(square) * inverse)
            total[a] += volume[b] * w
            if b < owned:
                total[b] += volume[a] * w


@kernel
def add_images(row, place, image, other, weight, inverse, total):
    """Add what particles see of images."""
    for k in range(len(row)):
        square = 0.0
        for i in range(place.shape[1]):
            square += (place[row[k], i] - image[other[k], i]) ** 2
        total[row[k]] += weight[other[k]] * shape(np.sqrt(square) * inverse)


@kernel
def take_places(rows, first, position, start, place, moved):
    """Places of rows (k,) into place[first : first + k], and what they moved from the places with which rows of
    `start` begin into moved[first : first + k]."""
    for k in range(len(rows)):
        for i in range(place.shape[1]):
            place[first + k, i] = position[rows[k], i]
            moved[first + k, i] = position[rows[k], i] - start[rows[k], i]


@kernel
def give_to_rows(source, rows, target):
    """Values (k, d) into rows (k,) of an array (n, d)."""
    for k in range(len(rows)):
        for i in range(source.shape[1]):
            target[rows[k], i] = source[k, i]


@kernel
def give_levels(level, first, rows, slot, target):
    """Numbers level[first : first + k] into a column of rows (k,) of an array (n, slots)."""
    for k in range(len(rows)):
        target[rows[k], slot] = level[first + k]


@kernel
def hand_over(entry, recipient, part, force, extra, forces):
    """Forces (2, k, d) of recipients: the sums of the forces (n, d) of their entries (m,), times the part (m,) that
    they are of whole particles' where not None, and of what the impulse has besides, None without any."""
    forces[:] = 0.0
    for m in range(len(entry)):
        share = 1.0 if part is None else part[m]
        for i in range(force.shape[1]):
            forces[0, recipient[m], i] += share * force[entry[m], i]
            if extra is not None:
                forces[1, recipient[m], i] += share * extra[entry[m], i]


@kernel
def start_anew(rows, force, position, shown, start):
    """Forces (k, d) and places of rows (k,) into those that are shown and from which the next step starts, (n, d)."""
    for k in range(len(rows)):
        for i in range(force.shape[1]):
            shown[rows[k], i], start[rows[k], i] = force[k, i], position[rows[k], i]


@kernel
def spread(moved):
    """Square [m^2] of the diagonal of the box of displacements (n, d), and of the one that has their negatives, too."""
    among, both = 0.0, 0.0
    for i in range(moved.shape[1]):
        low, high = math.inf, -math.inf
        for a in range(len(moved)):
            low, high = min(low, moved[a, i]), max(high, moved[a, i])
        among += (high - low) ** 2
        both += 4.0 * max(high, -low) ** 2
    return among, both


@kernel
def time_left(place, velocity, listed, body, of_body, near, ahead):
    """How long [s] this rank's particles stay within what lists and boxes allow, at most `ahead`.

    place, velocity, listed (n, d); body (n,). of_body: moving boxes (bodies, 5, d) now: lower and upper [m], the body's
    mean velocity [m/s], and in first components the margin [m], negative for bodies without contact, and a speed [m/s]
    by which particles may get faster. near: starts (bodies + 1,) and rows (m, 5, d): the partner's lower and upper now,
    the frame's velocity [m/s], its displacement since the build [m], and (allowed displacement, reach) [m].
    """
    d, left = place.shape[1], ahead
    start, rows = near
    for a in range(len(place)):
        A = body[a]
        margin, more = of_body[A, 3, 0], of_body[A, 4, 0]
        if margin < 0.0:
            continue
        for i in range(d):
            room = min(place[a, i] - of_body[A, 0, i], of_body[A, 1, i] - place[a, i]) + margin
            if room < left * (abs(velocity[a, i] - of_body[A, 2, i]) + more):
                left = room / (abs(velocity[a, i] - of_body[A, 2, i]) + more)
        for p in range(start[A], start[A + 1]):
            gap, square, faster = 0.0, 0.0, 0.0
            for i in range(d):
                v = velocity[a, i] - rows[p, 2, i]
                out = max(rows[p, 0, i] - place[a, i], place[a, i] - rows[p, 1, i], 0.0)
                gap += out * out
                u = place[a, i] - listed[a, i] - rows[p, 3, i]
                square += u * u
                faster += v * v
            speed = math.sqrt(faster) + more
            if gap < (rows[p, 4, 1] + speed * left) ** 2:
                left = min(left, (rows[p, 4, 0] - math.sqrt(square)) / speed)
    return left


@kernel
def longest_step(colour, constants, longest, share, level, before, step, most):
    """The least of the steps `longest` (owned,) [s] that those entries allow that see more than a share of their
    threshold, and of those in which their penetrations change as in the last one by no more than most[0] of R and
    most[1] of themselves; before (owned,) [m]: the penetrations at its start, step [s]; inf where none does."""
    least = math.inf
    for a in range(len(colour)):
        if colour[a] > share * constants[a, 0]:
            allowed = most[0] / constants[a, 3] + most[1] * max(level[a], 0.0)
            least = min(least, longest[a])
            # what saw less before has no rate yet: whether it had a colour then depends on when lists were made
            if before[a] > (share - 1.0) * constants[a, 0] * constants[a, 1]:
                least = min(least, step * allowed / max(abs(level[a] - before[a]), 1e-300))
    return least


@kernel
def time_until_pressed(constants, now, ahead, time, most):
    """The least of the times in which penetrations of owned entries reach most[0] of R, or grow by as much and most[1]
    of themselves, of those that change by more than most[2] of R in a time [s]; inf where none does; now, ahead
    (owned,) [m]: at its start and its end."""
    least = math.inf
    for a in range(len(now)):
        if ahead[a] > 0.0:
            change, allowed = ahead[a] - now[a], most[0] / constants[a, 3] + max(-now[a], most[1] * now[a])
            if change > max(allowed, most[2] / constants[a, 3]):
                least = min(least, time * allowed / change)
    return least
