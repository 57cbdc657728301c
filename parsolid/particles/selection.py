"""Some of a rank's particles, wherever they are."""

from typing import Any

import numpy as np


class Selection:
    """Some particles, wherever they are now: `rows` (k,) rises, and follows every re-ordering and migration."""

    def __init__(self, particles: Any, word: int, bit: int) -> None:
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
