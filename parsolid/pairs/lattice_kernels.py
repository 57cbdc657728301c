"""Kernels of the passes over all bonds of a lattice, see `lattice_sums`."""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.lanes import WIDTH, broadcast, fused, load, store
from parsolid.pairs.lane_tuples import add_lanes
from parsolid.pairs.terms import dimension_of


class Lines(NamedTuple):
    """Offsets in lines along the fast axis, by how far apart first parts are, one way and the other: second parts go
    from -reach (apart,) to reach int64; half (apart, ...) int64 of a line's length, second part 0 in the
    middle.
    """

    reach: np.ndarray
    half: np.ndarray


class Box(NamedTuple):
    """Places: so many lines (first, second), of so many places with those up to a multiple of four; before and behind
    them stand `lead` empty ones. halves: of lines of offsets, from 0; wanted (lines,): those with particles that
    receive.
    """

    first: int
    second: int
    room: int
    lead: int
    halves: int
    wanted: np.ndarray


class Rows(NamedTuple):
    """Of particles, ghosts behind: place (n,) int64 among all of the lattice; volume (n,). Of owned ones: target
    (owned,) int64 among places without leads, and sums over offsets, themselves among them: volumes (owned,), moments
    (owned, 3) of volumes along first, second and fast axis, in spacings.

    axis (d,) int64: which of these three an axis of space is; spacing (d,) [m].
    """

    place: np.ndarray
    target: np.ndarray
    volume: np.ndarray
    volumes: np.ndarray
    moments: np.ndarray
    axis: np.ndarray
    spacing: np.ndarray


class Mirrored(NamedTuple):
    """Mirror images on places of their own: source (m,) int64, the particle's row; origin, place (m,) int64 of particle
    and image; code (m,) int64 of reflections.
    """

    source: np.ndarray
    origin: np.ndarray
    place: np.ndarray
    code: np.ndarray


# --- sums over lines ---------------------------------------------------------------------------------------------


@register_jitable
def _add_up(box, values, line, sums, row):
    """Sums of the lines of all lengths about each place of a line into rows of sums, the first of these being row."""
    for z in range(0, box.room, WIDTH):
        total = load(values, line, box.lead + z)
        store(sums, row, z, total)
        for half in range(1, box.halves):
            behind, ahead = load(values, line, box.lead + z - half), load(values, line, box.lead + z + half)
            total = total + (ahead + behind)
            store(sums, row + half, z, total)


@register_jitable
def _tilt(box, values, plain, line, slopes, row):
    """The same of values times how far they stand, and of plain ones unless None."""
    for z in range(0, box.room, WIDTH):
        slope = broadcast(0.0)
        if plain is not None:
            slope = load(plain, line, box.lead + z)
        store(slopes, row, z, slope)
        for half in range(1, box.halves):
            behind, ahead = load(values, line, box.lead + z - half), load(values, line, box.lead + z + half)
            slope = fused(float(half), ahead - behind, slope)
            if plain is not None:
                slope = slope + (load(plain, line, box.lead + z + half) + load(plain, line, box.lead + z - half))
            store(slopes, row + half, z, slope)


@register_jitable
def _span(box, lines, apart, y):
    """Second parts, first to last, of the offsets in a plane so far apart whose lines exist about the y-th."""
    reach = lines.reach[apart]
    return max(-reach, -y), min(reach, box.second - 1 - y)


@register_jitable
def _receiver(box, x, y):
    """The number of a line with particles that receive, else -1."""
    line = x * box.second + y
    return line if x >= 0 and x < box.first and box.wanted[line] else -1


@compiled(fastmath={"contract"}, error_model="numpy")
def moments(box, lines, values, across, result, sums, slopes):
    """Fill result (4, lines, room): sums over offsets of values (lines, places), and of values times each offset's
    first (unless across is None: no offset has one), second and fast part. sums, slopes (second halves, room): to work
    in.
    """
    result[:] = 0.0
    plain, first, second, fast = result[0], result[1], result[2], result[3]
    for x in range(box.first):
        for y in range(box.second):
            _add_up(box, values, x * box.second + y, sums, y * box.halves)
            _tilt(box, values, None, x * box.second + y, slopes, y * box.halves)
        for apart in range(lines.reach.shape[0]):
            for y in range(box.second):
                low, high = _span(box, lines, apart, y)
                before, behind = _receiver(box, x - apart, y), _receiver(box, x + apart, y)
                for z in range(0, box.room if max(before, behind) >= 0 else 0, WIDTH):
                    total, along, slope = broadcast(0.0), broadcast(0.0), broadcast(0.0)
                    for step in range(low, high + 1):
                        row = (y + step) * box.halves + lines.half[apart, step + lines.half.shape[1] // 2]
                        term = load(sums, row, z)
                        total, along = total + term, fused(float(step), term, along)
                        slope = slope + load(slopes, row, z)
                    for side in range(2 if apart > 0 else 1):
                        target = behind if side == 1 else before
                        if target >= 0:
                            add_lanes(plain, target, z, (total,))
                            if across is not None:
                                add_lanes(first, target, z, ((apart if side == 0 else -apart) * total,))
                            add_lanes(second, target, z, (along,))
                            add_lanes(fast, target, z, (slope,))


@compiled(fastmath={"contract"}, error_model="numpy")
def contraction(box, lines, values, across, plain, result, sums, slopes):
    """Fill result (lines, room): sums over offsets of values (4, lines, places), the last three of them times the
    offset's first (unless across is None), second and fast part, and of plain (lines, places) unless None. sums
    (2, second halves, room), slopes: to work in.
    """
    result[:] = 0.0
    firsts, seconds = sums[0], sums[1]
    for x in range(box.first):
        for y in range(box.second):
            line, row = x * box.second + y, y * box.halves
            if across is not None:
                _add_up(box, values[1], line, firsts, row)
            _add_up(box, values[2], line, seconds, row)
            _tilt(box, values[3], plain, line, slopes, row)
        for apart in range(lines.reach.shape[0]):
            for y in range(box.second):
                low, high = _span(box, lines, apart, y)
                before, behind = _receiver(box, x - apart, y), _receiver(box, x + apart, y)
                for z in range(0, box.room if max(before, behind) >= 0 else 0, WIDTH):
                    total, jump = broadcast(0.0), broadcast(0.0)
                    for step in range(low, high + 1):
                        row = (y + step) * box.halves + lines.half[apart, step + lines.half.shape[1] // 2]
                        total = total + fused(float(step), load(seconds, row, z), load(slopes, row, z))
                        if across is not None:
                            jump = jump + load(firsts, row, z)
                    if before >= 0:
                        add_lanes(result, before, z, (fused(float(apart), jump, total),))
                    if behind >= 0 and apart > 0:
                        add_lanes(result, behind, z, (fused(-float(apart), jump, total),))


# --- from rows to places and back --------------------------------------------------------------------------------


@compiled(error_model="numpy")
def reflect(mirrored, signs, values):
    """Fill values (components, places) of images: those of the particles times signs (codes, components)."""
    for k in range(values.shape[0]):
        for m in range(mirrored.place.shape[0]):
            values[k, mirrored.place[m]] = signs[mirrored.code[m], k] * values[k, mirrored.origin[m]]


@compiled(fastmath={"contract"}, error_model="numpy")
def spread(space, rows, column, kinematics, base, values):
    """Fill V (f - base) of a vector in some columns into values (d, places)."""
    d = dimension_of(space)
    for b in range(rows.place.shape[0]):
        for i in range(d):
            values[i, rows.place[b]] = rows.volume[b] * (kinematics[b, column + i] - base[i])


@compiled(fastmath={"contract"}, error_model="numpy")
def collect(space, rows, width, column, kinematics, base, result, jumps, sums):
    """Add the gradients' sums of result (d, 4, targets); jumps (owned, d): sum V_b (f_b - f_a)."""
    d = dimension_of(space)
    for a in range(rows.volumes.shape[0]):
        z = rows.target[a]
        for i in range(d):
            value = kinematics[a, column + i] - base[i]
            jumps[a, i] = result[i, 0, z] - rows.volumes[a] * value
            for j in range(d):
                k = rows.axis[j]
                moment = result[i, 1 + k, z] - rows.moments[a, k] * value
                sums[a, width * j + i] += rows.volume[a] * rows.spacing[j] * moment


@compiled(fastmath={"contract"}, error_model="numpy")
def spread_records(space, rows, width, stiffness, kinematics, base, record, values):
    """Fill V M h, and V C1 f unless stiffness, the first column of C1, is None, into values (d, 4, places)."""
    d = dimension_of(space)
    for b in range(rows.place.shape[0]):
        place, volume = rows.place[b], rows.volume[b]
        for i in range(d):
            for j in range(d):
                values[i, 1 + rows.axis[j], place] = volume * rows.spacing[j] * record[b, width * j + i]
            if stiffness is not None:
                total = 0.0
                for j in range(d):
                    total += record[b, stiffness + width * j + i] * (kinematics[b, j] - base[j])
                values[i, 0, place] = volume * total


@compiled(fastmath={"contract"}, error_model="numpy")
def collect_forces(space, rows, width, stiffness, stiffnesses, kinematics, base, record, result, jumps, force):
    """Add forces of result (d, targets); stiffnesses (owned, d, d): sum V_b C1_b."""
    d = dimension_of(space)
    for a in range(rows.volumes.shape[0]):
        for i in range(d):
            total = result[i, rows.target[a]]
            for j in range(d):
                total += record[a, width * j + i] * rows.spacing[j] * rows.moments[a, rows.axis[j]]
                if stiffness is not None:
                    total += record[a, stiffness + width * j + i] * jumps[a, j]
                    total -= stiffnesses[a, i, j] * (kinematics[a, j] - base[j])
            force[a, i] += rows.volume[a] * total
