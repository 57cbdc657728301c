"""The fields of a rank's particles. Every field is declared once (`declaration.Field`).

Allocation, halo exchange, migration, order, checkpoint and restart are loops over the declarations in this module.
Rows are particles: owned ones first, sorted by material, then ghosts, then padding.
"""

from collections.abc import Callable, Iterable
from math import prod
from typing import Any, TypeVar

import numpy as np

from parsolid.kernels import aligned_zeros
from parsolid.particles.declaration import Columns, Field, Rows, Within

Kept = TypeVar("Kept")
# most particles that kernels handle side by side
_LANES = 8
# selections in one word of marks
_BITS = 62


def _room(rows: int) -> int:
    """Length of an array in which a group of _LANES may begin at any of `rows`."""
    return -(-rows // _LANES) * _LANES + _LANES


class Selection:
    """Some particles; `rows` (k,) rises and is up to date after every re-ordering and migration."""

    def __init__(self, particles: "Particles", word: int, bit: int) -> None:
        self._particles, self._word, self._bit = particles, word, np.int64(1) << np.int64(bit)
        self._layout, self._rows = -1, np.zeros(0, np.int64)

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles that are selected."""
        particles = self._particles
        if self._layout != particles.layout:
            marks = particles.marks[: particles.owned, self._word]
            self._layout, self._rows = particles.layout, np.flatnonzero(marks & self._bit)
        return self._rows

    def __len__(self) -> int:
        return len(self.rows)


class Particles:
    """Fields of a rank's particles; material g has rows bounds[g] .. bounds[g + 1] - 1.

    owned, ghosts: numbers of rows; capacity: rows of arrays without ghosts; layout: number of changes of the rows of
    particles, by which row numbers kept elsewhere become invalid; growths: number of replacements of arrays. Kernels
    take `storage(name)`.
    """

    def __init__(self, body: np.ndarray, law_of_body: np.ndarray | None = None) -> None:
        """body (n,): index of each particle's body, sorted by law.

        law_of_body (bodies,): number of each body's law, one for all unless given.
        """
        count = int(body.max(initial=-1)) + 1
        self.law_of_body = np.zeros(max(1, count), np.int64) if law_of_body is None else law_of_body
        law = self.law_of_body[body]
        self.bounds = np.searchsorted(law, np.arange(self.law_of_body.max(initial=0) + 2))
        self.ghosts = 0
        self.capacity = _room(len(body))
        self.fields: dict[str, Field] = {}
        self.layout, self.growths = 0, 0
        self._storage: dict[str, np.ndarray] = {}
        # views and tuples of arrays that every step uses; cleared when arrays are replaced or bounds change
        self._kept: dict[Any, Any] = {}
        self._halo = None
        self._messages: dict[str, Any] = {}
        self._selections = 0
        self.declare(Field("body", 1, "1", checkpointed=True, shown=True, whole=True), body)

    @property
    def owned(self) -> int:
        """Number of this rank's own particles."""
        return int(self.bounds[-1])

    # --- declaration ------------------------------------------------------------------------------------------

    def declare(self, field: Field, values: Any = 0) -> None:
        """Add a field; values: of the owned particles, (n,), (n, components), one row, or a number.

        Raises ValueError for a second field of that name.
        """
        if field.name in self.fields:
            raise ValueError(f"fields: expected one of the name {field.name}, found two")
        self.fields[field.name] = field
        if not isinstance(field.layout, Within):
            self._storage[field.name] = self._allocated(field, self._rows_of(field))
        elif field.ghosts is not None:
            record = self.fields[field.layout.record]
            self._storage[record.name] = self._resized(record, self._storage[record.name])
        self._messages.pop(field.message, None)
        self._kept.clear()
        self[field.name][: self.owned] = values

    def _has_ghosts(self, field: Field) -> bool:
        """Whether the array of a field has rows for ghosts: the field, or a field within it, is exchanged."""
        return field.ghosts is not None or any(
            isinstance(part.layout, Within) and part.layout.record == field.name and part.ghosts is not None
            for part in self.fields.values()
        )

    def _rows_of(self, field: Field) -> int:
        """Rows that the array of a field needs."""
        ghosts = _room(self.owned + self.ghosts) if self._has_ghosts(field) else 0
        return max(self.capacity, ghosts)

    def _allocated(self, field: Field, rows: int) -> np.ndarray:
        if isinstance(field.layout, Columns):
            result = aligned_zeros((field.components, rows), field.dtype)
            if field.padding:
                result[:] = np.array(field.padding)[:, None]
            return result
        width = field.layout.width if isinstance(field.layout, Rows) else None
        single = field.components == 1 and field.mirror == "scalar" and width is None
        shape = (rows,) if single else (rows, width or field.components)
        result = aligned_zeros(shape, field.dtype)
        if field.padding:
            result[:] = field.padding
        return result

    def __contains__(self, name: str) -> bool:
        return name in self.fields

    def __getitem__(self, name: str) -> np.ndarray:
        """A view of all rows of a field, (rows,) for a scalar, else (rows, components).

        Raises KeyError for a field that is not declared.
        """
        field = self.fields[name]
        if isinstance(field.layout, Within):
            whole, first = self._by_particle(field.layout.record), field.layout.first
            array = whole[:, first : first + field.components]
        else:
            array = self._by_particle(name)
            array = array[:, None] if array.ndim == 1 else array[:, : field.components]
        return array[:, 0] if field.components == 1 and field.mirror == "scalar" else array

    def owned_rows(self, name: str) -> np.ndarray:
        """A view of the owned particles' values of a field."""
        found: np.ndarray | None = self._kept.get(name)
        if found is None:
            found = self._kept[name] = self[name][: self.owned]
        return found

    def kept(self, key: tuple[Any, ...], make: Callable[[], Kept]) -> Kept:
        """The result of `make`, computed again only after arrays were replaced or particles came or left."""
        found: Kept | None = self._kept.get(key)
        if found is None:
            found = self._kept[key] = make()
        return found

    def storage(self, name: str) -> np.ndarray:
        """The array of a field or record, for kernels; it may be replaced when particles come."""
        return self._storage[name]

    def _by_particle(self, name: str) -> np.ndarray:
        """The array with particles along its first axis."""
        array = self._storage[name]
        return array.T if isinstance(self.fields[name].layout, Columns) else array

    # --- ghosts -----------------------------------------------------------------------------------------------

    def attach(self, halo: Any) -> None:
        """Add rows for the ghosts of a `decomposition.Halo`; the next messages fill them. Collective."""
        self.detach()
        self._kept.clear()
        self._halo, self.ghosts = halo, halo.ghosts
        for name, array in self._storage.items():
            if self._has_ghosts(self.fields[name]):
                self._storage[name] = self._resized(self.fields[name], array)
        self.growths += 1

    def detach(self) -> None:
        """Remove the ghosts, before particles move to other ranks or new neighbours are found."""
        for message in self._messages.values():
            message.free()
        self._messages.clear()
        self._halo, self.ghosts = None, 0

    def _resized(self, field: Field, array: np.ndarray) -> np.ndarray:
        """The array, or a longer one with the same owned rows."""
        rows, columns = self._rows_of(field), isinstance(field.layout, Columns)
        if array.shape[-1 if columns else 0] >= rows:
            return array
        new = self._allocated(field, rows)
        place = (slice(None), slice(self.owned)) if columns else slice(self.owned)
        new[place] = array[place]
        return new

    def _message(self, name: str) -> Any:
        if name not in self._messages:
            members = [field for field in self.fields.values() if field.message == name and field.ghosts is not None]
            kinds = {field.ghosts for field in members}
            if len(kinds) != 1:
                raise ValueError(
                    f"{name}: expected a message of fields that go one way, found {sorted(map(str, kinds))}"
                )
            halo: Any = self._halo
            make = halo.forward if kinds == {"forward"} else halo.reverse
            self._messages[name] = make(*(self[field.name] for field in members))
        return self._messages[name]

    def send(self, message: str) -> None:
        """Start to exchange the fields of a message with the neighbouring ranks."""
        (self._messages.get(message) or self._message(message)).start()

    def receive(self, message: str) -> None:
        self._messages[message].finish()

    def update(self, message: str) -> None:
        """Send and receive a message, if any field has it, and free its buffers; for set-up. Collective."""
        if any(field.message == message and field.ghosts is not None for field in self.fields.values()):
            self.send(message)
            self.receive(message)
            self._messages.pop(message).free()

    def bytes_sent(self, message: str) -> int:
        return self._message(message).bytes_sent if self._halo is not None else 0

    # --- particles come, go and change places -----------------------------------------------------------------

    def _carried(self) -> list[str]:
        """Fields with arrays of their own that travel with a particle."""
        return [name for name in self._storage if self.fields[name].carried]

    def packed(self, rows: np.ndarray) -> np.ndarray:
        """All fields of some particles, (n, c) float64; integers keep their bits."""
        if not len(rows):
            # the most frequent case
            return np.zeros((0, sum(prod(self._by_particle(name).shape[1:]) for name in self._carried())))
        pieces = []
        for name in self._carried():
            values = np.ascontiguousarray(self._by_particle(name)[rows]).view(np.float64)
            pieces.append(values.reshape(len(rows), int(np.prod(values.shape[1:]))))
        return np.concatenate(pieces, axis=1)

    def insert(self, packed: np.ndarray) -> None:
        """Add particles that another rank has packed."""
        if not len(packed):
            return
        values, at = {}, 0
        for name in self._carried():
            array = self._by_particle(name)
            width = int(np.prod(array.shape[1:]))
            values[name] = np.ascontiguousarray(packed[:, at : at + width]).view(array.dtype)
            at += width
        law = self.law_of_body[values["body"].ravel()]
        added = np.bincount(law, minlength=len(self.bounds) - 1)
        if _room(self.owned + len(packed)) > self.capacity:
            owned = self.owned + len(packed)
            self.capacity = _room(owned + owned // 4)
            self._kept.clear()
            for name, array in self._storage.items():
                self._storage[name] = self._resized(self.fields[name], array)
            self.growths += 1
        places = self._make_room(law, added)
        for name, piece in values.items():
            array = self._by_particle(name)
            array[places] = piece.reshape(len(places), *array.shape[1:])
        self.bounds = self.bounds + np.concatenate(([0], np.cumsum(added)))
        self._kept.clear()
        self.layout += 1

    def _make_room(self, law: np.ndarray, added: np.ndarray) -> np.ndarray:
        """Rows (n,) for new particles by their law; each material makes room for those before it."""
        shift, places = np.concatenate(([0], np.cumsum(added))), np.empty(len(law), np.int64)
        for g in range(len(added) - 1, -1, -1):
            first, last = self.bounds[g], self.bounds[g + 1]
            # by moving its first particles behind its last
            count = min(shift[g], last - first)
            self._move(np.arange(first, first + count), np.arange(last + shift[g] - count, last + shift[g]))
            places[law == g] = np.arange(last + shift[g], last + shift[g + 1])
        return places

    def remove(self, rows: np.ndarray) -> None:
        if not len(rows):
            return
        gone = np.zeros(self.owned, bool)
        gone[rows] = True
        bounds, shift = self.bounds.copy(), 0
        for g in range(len(bounds) - 1):
            first, last = self.bounds[g], self.bounds[g + 1]
            removed = int(gone[first:last].sum())
            keep = last - removed
            self._move(np.arange(keep, last)[~gone[keep:last]], np.arange(first, keep)[gone[first:keep]])
            # the last particles of the material fill the gap before it
            count = min(shift, keep - first)
            self._move(np.arange(keep - count, keep), np.arange(first - shift, first - shift + count))
            bounds[g], shift = first - shift, shift + removed
        bounds[-1] -= shift
        self.bounds = bounds
        self._kept.clear()
        self.layout += 1

    def _move(self, source: np.ndarray, target: np.ndarray) -> None:
        if len(source):
            for name in self._carried():
                array = self._by_particle(name)
                array[target] = array[source]

    def reorder(self, order: np.ndarray) -> None:
        """Sort the particles of each material by `order` (owned,), a list of rows."""
        if len(self.bounds) > 2:
            order = order[np.argsort(self.law_of_body[self["body"][order]], kind="stable")]
        for name in self._carried():
            array = self._by_particle(name)
            array[: self.owned] = array[order]
        self.layout += 1

    # --- some of them -----------------------------------------------------------------------------------------

    def selection(self, mask: np.ndarray) -> Selection:
        """The owned particles where a mask (owned,) is true; all ranks make the same selections in the same order."""
        word, bit = divmod(self._selections, _BITS)
        self._selections += 1
        name = f"marks_{word}"
        if bit == 0:
            self.declare(Field(name, 1, "bits", whole=True, layout=Rows(1)))
        self.owned_rows(name)[mask] |= np.int64(1) << np.int64(bit)
        return Selection(self, word, bit)

    @property
    def marks(self) -> np.ndarray:
        """Words (rows, k) whose bits say which selections a particle is in."""
        words = [self._storage[f"marks_{word}"] for word in range(-(-self._selections // _BITS))]
        return words[0] if len(words) == 1 else np.concatenate(words, axis=1)

    # --- what is written --------------------------------------------------------------------------------------

    def checkpointed(self) -> dict[str, np.ndarray]:
        """The fields that a restart needs, by name."""
        return {name: self.owned_rows(name) for name, field in self.fields.items() if field.checkpointed}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        for name, array in self.checkpointed().items():
            array[...] = values[name].reshape(array.shape)

    def storages(self) -> Iterable[np.ndarray]:
        return self._storage.values()
