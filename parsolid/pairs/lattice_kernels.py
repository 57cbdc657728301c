"""Kernels of the passes over all bonds of a lattice, see `lattice_sums`."""

from typing import NamedTuple

import numpy as np
from numba.extending import overload, register_jitable

from decomposition.compiled import compiled
from parsolid.numerics.lanes import WIDTH, broadcast, fused, load, store
from parsolid.pairs.terms import dimension_of


class Lines(NamedTuple):
    """Offsets in lines: first, second (lines,) int64 of a line across, half (lines,) int64 of its length."""

    first: np.ndarray
    second: np.ndarray
    half: np.ndarray


class Box(NamedTuple):
    """Places: so many lines (first, second), of so many places with those up to a multiple of four; before and behind
    them stand `lead` empty ones. wanted (lines,): those with particles that receive.
    """

    first: int
    second: int
    room: int
    lead: int
    wanted: np.ndarray


class Rows(NamedTuple):
    """Of particles, ghosts behind: line, place (n,) int64; volume (n,). Of owned ones sums over offsets, themselves
    among them: volumes (owned,), moments (owned, 3) of volumes along first, second and fast axis, in spacings.

    axis (d,) int64: which of these three an axis of space is; spacing (d,) [m].
    """

    line: np.ndarray
    place: np.ndarray
    volume: np.ndarray
    volumes: np.ndarray
    moments: np.ndarray
    axis: np.ndarray
    spacing: np.ndarray


def size_of(space):
    """The dimension of a space; a constant in kernels."""
    return space.dimension


@overload(size_of)
def _size_of(space):
    dimension = dimension_of(space)
    return lambda space: dimension


# --- sums over lines ---------------------------------------------------------------------------------------------


@register_jitable
def _add_up(box, values, line, sums, slopes):
    """Fill sums, and slopes where there are any, (halves, room): over lines about each place, of values and of values
    times how far they stand.
    """
    for z in range(0, box.room, WIDTH):
        total, slope = load(values, line, box.lead + z), broadcast(0.0)
        store(sums, 0, z, total)
        if slopes is not None:
            store(slopes, 0, z, slope)
        for half in range(1, sums.shape[0]):
            behind, ahead = load(values, line, box.lead + z - half), load(values, line, box.lead + z + half)
            total = total + (ahead + behind)
            store(sums, half, z, total)
            if slopes is not None:
                slope = fused(float(half), ahead - behind, slope)
                store(slopes, half, z, slope)


@register_jitable
def _add(array, line, z, value):
    store(array, line, z, load(array, line, z) + value)


@register_jitable
def _target(box, lines, line, number):
    """The line of the places that see a line as that of their offsets' so-and-so, -1 for none; first and second part of
    these offsets.
    """
    first, second = lines.first[number], lines.second[number]
    x, y = line // box.second - first, line % box.second - second
    inside = x >= 0 and x < box.first and y >= 0 and y < box.second
    target = x * box.second + y if inside and box.wanted[x * box.second + y] else -1
    return target, float(first), float(second)


@compiled(fastmath={"contract"}, error_model="numpy")
def moments(box, lines, values, across, result, sums, slopes):
    """Fill result (4, lines, room): sums over offsets of values (lines, places), and of values times each offset's
    first (unless across is None: no offset has one), second and fast part. sums, slopes (halves, room): to work in.
    """
    result[:] = 0.0
    for line in range(values.shape[0]):
        _add_up(box, values, line, sums, slopes)
        for number in range(lines.half.shape[0]):
            target, first, second = _target(box, lines, line, number)
            half = lines.half[number]
            for z in range(0, box.room if target >= 0 else 0, WIDTH):
                total = load(sums, half, z)
                _add(result[0], target, z, total)
                if across is not None:
                    _add(result[1], target, z, first * total)
                _add(result[2], target, z, second * total)
                _add(result[3], target, z, load(slopes, half, z))


@compiled(fastmath={"contract"}, error_model="numpy")
def contraction(box, lines, values, across, plain, result, sums, slopes):
    """Fill result (lines, room): sums over offsets of values (4, lines, places) times 1 (unless plain is None), and
    the offset's first (unless across is None), second and fast part. sums (4, halves, room), slopes: to work in.
    """
    result[:] = 0.0
    for line in range(values.shape[1]):
        if across is not None:
            _add_up(box, values[1], line, sums[1], None)
        if plain is not None:
            _add_up(box, values[0], line, sums[0], None)
        _add_up(box, values[2], line, sums[2], None)
        _add_up(box, values[3], line, sums[3], slopes)
        for number in range(lines.half.shape[0]):
            (target, first, second), half = _target(box, lines, line, number), lines.half[number]
            for z in range(0, box.room if target >= 0 else 0, WIDTH):
                total = fused(second, load(sums[2], half, z), load(slopes, half, z))
                if plain is not None:
                    total = total + load(sums[0], half, z)
                if across is not None:
                    total = fused(first, load(sums[1], half, z), total)
                _add(result, target, z, total)


# --- from rows to places and back --------------------------------------------------------------------------------


@compiled(fastmath={"contract"}, error_model="numpy")
def spread(space, rows, column, kinematics, base, values):
    """Fill V (f - base) of a vector in some columns into values (d, lines, places); base (d,): that of row 0."""
    d = size_of(space)
    for i in range(d):
        base[i] = kinematics[0, column + i]
    for b in range(rows.line.shape[0]):
        for i in range(d):
            values[i, rows.line[b], rows.place[b]] = rows.volume[b] * (kinematics[b, column + i] - base[i])


@compiled(fastmath={"contract"}, error_model="numpy")
def collect(space, rows, lead, width, column, kinematics, base, result, jumps, sums):
    """Add the gradients' sums; jumps (owned, d): sum V_b (f_b - f_a)."""
    d = size_of(space)
    for a in range(rows.volumes.shape[0]):
        line, z = rows.line[a], rows.place[a] - lead
        for i in range(d):
            value = kinematics[a, column + i] - base[i]
            jumps[a, i] = result[i, 0, line, z] - rows.volumes[a] * value
            for j in range(d):
                k = rows.axis[j]
                moment = result[i, 1 + k, line, z] - rows.moments[a, k] * value
                sums[a, width * j + i] += rows.volume[a] * rows.spacing[j] * moment


@compiled(fastmath={"contract"}, error_model="numpy")
def spread_records(space, rows, width, stiffness, kinematics, base, record, values):
    """Fill V M h, and V C1 f unless stiffness, the first column of C1, is None, into values (d, 4, lines, places)."""
    d = size_of(space)
    for b in range(rows.line.shape[0]):
        line, place, volume = rows.line[b], rows.place[b], rows.volume[b]
        for i in range(d):
            for j in range(d):
                value = volume * rows.spacing[j] * record[b, width * j + i]
                values[i, 1 + rows.axis[j], line, place] = value
            if stiffness is not None:
                total = 0.0
                for j in range(d):
                    total += record[b, stiffness + width * j + i] * (kinematics[b, j] - base[j])
                values[i, 0, line, place] = volume * total


@compiled(fastmath={"contract"}, error_model="numpy")
def collect_forces(space, rows, lead, width, stiffness, stiffnesses, kinematics, base, record, result, jumps, force):
    """Add forces; stiffnesses (owned, d, d): sum V_b C1_b."""
    d = size_of(space)
    for a in range(rows.volumes.shape[0]):
        line, z = rows.line[a], rows.place[a] - lead
        for i in range(d):
            total = result[i, line, z]
            for j in range(d):
                total += record[a, width * j + i] * rows.spacing[j] * rows.moments[a, rows.axis[j]]
                if stiffness is not None:
                    total += record[a, stiffness + width * j + i] * jumps[a, j]
                    total -= stiffnesses[a, i, j] * (kinematics[a, j] - base[j])
            force[a, i] += rows.volume[a] * total
