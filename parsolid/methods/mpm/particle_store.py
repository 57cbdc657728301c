"""Arrays of particles that come and go: one law after the other, room at the end, growth when it is used up."""

import numpy as np

from parsolid.numerics.lanes import WIDTH, aligned_zeros, padded


class ParticleStore:
    """Arrays by name; particles of law g are rows bounds[g] .. bounds[g + 1] - 1 of all of them.

    An array has a row a particle, (capacity,) or (capacity, c), or a column a particle, (c, capacity), for kernels that take four
    neighbours at once. Rows beyond `owned` are padding. `changes` counts how often particles were moved, `growths` how often arrays
    were replaced by larger ones.
    """

    def __init__(self, law_of_body: np.ndarray, body: np.ndarray):
        """law_of_body (bodies,): number of each body's law; body (n,): of this rank's particles, sorted by law."""
        self.law_of_body = law_of_body
        law = law_of_body[body]
        self.bounds = np.searchsorted(law, np.arange(law_of_body.max(initial=0) + 2))
        self.capacity = padded(len(body)) + WIDTH
        self.arrays: dict[str, np.ndarray] = {}
        self._columns: set[str] = set()
        self.changes, self.growths = 0, 0
        self.add("body", body)

    @property
    def owned(self) -> int:
        """Number of particles."""
        return int(self.bounds[-1])

    def add(self, name: str, values: np.ndarray) -> None:
        """A row a particle, from the particles' values (n,) or (n, c)."""
        self.arrays[name] = aligned_zeros((self.capacity, *values.shape[1:]), values.dtype)
        self.arrays[name][: self.owned] = values

    def add_columns(self, name: str, count: int) -> None:
        """A column of `count` zeros a particle."""
        self.arrays[name] = aligned_zeros((count, self.capacity))
        self._columns.add(name)

    def by_particle(self, name: str) -> np.ndarray:
        """The array with particles along its first axis."""
        return self.arrays[name].T if name in self._columns else self.arrays[name]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.arrays[name]

    def packed(self, rows: np.ndarray) -> np.ndarray:
        """All values of some particles, (n, c) float64; whole numbers keep their bits."""
        pieces = []
        for name in self.arrays:
            values = self.by_particle(name)[rows]
            if values.dtype.kind == "i":
                values = values.astype(np.int64).view(np.float64)
            pieces.append(values.reshape(len(rows), int(np.prod(values.shape[1:]))))
        return np.concatenate(pieces, axis=1)

    def insert(self, packed: np.ndarray) -> None:
        """Take in particles that another rank has packed."""
        values, at = {}, 0
        for name in self.arrays:
            array = self.by_particle(name)
            width = int(np.prod(array.shape[1:]))
            piece = np.ascontiguousarray(packed[:, at : at + width])
            values[name] = piece.view(np.int64) if array.dtype.kind == "i" else piece
            at += width
        law = self.law_of_body[values["body"].ravel()]
        added = np.bincount(law, minlength=len(self.bounds) - 1)
        if self.owned + len(packed) + WIDTH > self.capacity:
            self._grow(self.owned + len(packed))
        shift = np.concatenate(([0], np.cumsum(added)))
        places = np.empty(len(packed), np.int64)
        for g in range(len(added) - 1, -1, -1):
            first, last = self.bounds[g], self.bounds[g + 1]
            # the block makes room for those before it by moving its first particles behind its last
            count = min(shift[g], last - first)
            self._move(np.arange(first, first + count), np.arange(last + shift[g] - count, last + shift[g]))
            places[law == g] = np.arange(last + shift[g], last + shift[g + 1])
        for name, piece in values.items():
            array = self.by_particle(name)
            array[places] = piece.reshape(len(places), *array.shape[1:])
        self.bounds = self.bounds + shift
        self.changes += 1

    def remove(self, rows: np.ndarray) -> None:
        """Forget particles; others take their places."""
        gone = np.zeros(self.owned, bool)
        gone[rows] = True
        bounds, shift = self.bounds.copy(), 0
        for g in range(len(bounds) - 1):
            first, last = self.bounds[g], self.bounds[g + 1]
            removed = int(gone[first:last].sum())
            keep = last - removed
            self._move(np.arange(keep, last)[~gone[keep:last]], np.arange(first, keep)[gone[first:keep]])
            # the block closes the gap before it with its last particles
            count = min(shift, keep - first)
            self._move(np.arange(keep - count, keep), np.arange(first - shift, first - shift + count))
            bounds[g], shift = first - shift, shift + removed
        bounds[-1] -= shift
        self.bounds = bounds
        self.changes += 1

    def _move(self, source: np.ndarray, target: np.ndarray) -> None:
        if len(source):
            for name in self.arrays:
                array = self.by_particle(name)
                array[target] = array[source]

    def reorder(self, order: np.ndarray) -> None:
        """Bring the particles of each law into the order (owned,) that they are listed in."""
        if len(self.bounds) > 2:
            order = order[np.argsort(self.law_of_body[self["body"][order]], kind="stable")]
        for name, array in self.arrays.items():
            if name in self._columns:
                array[:, : self.owned] = array[:, order]
            else:
                array[: self.owned] = array[order]
        self.changes += 1

    def _grow(self, owned: int) -> None:
        self.capacity = padded(owned + owned // 4) + WIDTH
        for name, array in self.arrays.items():
            old = self.by_particle(name)
            shape = (len(array), self.capacity) if name in self._columns else (self.capacity, *array.shape[1:])
            self.arrays[name] = aligned_zeros(shape, array.dtype)
            self.by_particle(name)[: len(old)] = old
        self.growths += 1
