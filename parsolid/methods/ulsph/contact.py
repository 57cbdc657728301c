"""Which pairs are of one body and which of two: the latter are swept apart, so that bodies cost nothing within."""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from parsolid.pairs.lists import Images, images_of


@compiled
def _sorted_out(start, neighbour, body):
    """Starts of pairs of one body and of pairs of two, and the places of both in the list."""
    rows = len(start) - 1
    same, other = np.zeros(rows + 1, np.int64), np.zeros(rows + 1, np.int64)
    within, between = np.empty(len(neighbour), np.int64), np.empty(len(neighbour), np.int64)
    n, m = 0, 0
    for a in range(rows):
        for k in range(start[a], start[a + 1]):
            if body[0, a] == body[0, neighbour[k]]:
                within[n] = k
                n += 1
            else:
                between[m] = k
                m += 1
        same[a + 1], other[a + 1] = n, m
    return same, within[:n], other, between[:m]


class PairsOfBodies:
    """The lists of `MovingPairs`, each as [(pairs of one body, None), (pairs of two, contact)]; made anew with them.

    contact: `terms.Welded` or `terms.CompressionOnly`, None with one body.
    """

    def __init__(self, contact: Any):
        self.contact = contact
        self._pieces: dict[int, list[tuple[Any, Any]]] = {}

    def follow(self, pairs: Any, particles: Any) -> None:
        """Sort out the lists that were made; particles have the field "contact_body"."""
        lists = [one for one in (pairs.inner, pairs.rim, pairs.mirror) if one is not None]
        if self.contact is None:
            self._pieces = {id(one): [(one, None)] for one in lists}
        else:
            body = particles.storage("contact_body")
            self._pieces = {id(one): self._split(one, body) for one in lists}

    def _split(self, pairs: Any, body: np.ndarray) -> list[tuple[Any, Any]]:
        same, within, other, between = _sorted_out(pairs.start, pairs.neighbour, body)
        if not len(between):
            return [(pairs, None)]
        return [(_part(pairs, same, within), None), (_part(pairs, other, between), self.contact)]

    def of(self, pairs: Any) -> list[tuple[Any, Any]]:
        """The pieces of a list."""
        return self._pieces[id(pairs)]


def _part(pairs: Any, start: np.ndarray, places: np.ndarray) -> Any:
    part, images = pairs._replace(start=start, neighbour=pairs.neighbour[places]), images_of(pairs)
    return part if images is None else part._replace(images=Images(images.code[places], images.table))
