"""Kernels that make lists of contact and sum colours of the reference."""

import numpy as np

from decomposition.compiled import compiled
from parsolid.contact.kernel import shape


@compiled
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


@compiled
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


@compiled(error_model="numpy")
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


@compiled(error_model="numpy")
def add_images(row, place, image, other, weight, inverse, total):
    """Add what particles see of images."""
    for k in range(len(row)):
        square = 0.0
        for i in range(place.shape[1]):
            square += (place[row[k], i] - image[other[k], i]) ** 2
        total[row[k]] += weight[other[k]] * shape(np.sqrt(square) * inverse)
