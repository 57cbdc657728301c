"""A quantity that a method itself knows, see `MethodSettings.extra_quantities`."""

import numpy as np

from parsolid.observables.declared import Sampler, Watched

# a system in which there is no such thing says NaN, as of the tip of no crack
_JOIN = {"sum": np.add, "minimum": np.fmin, "maximum": np.fmax}


class MethodQuantity(Sampler):
    """A quantity of the systems whose method knows it, by the name in a scene."""

    def __init__(self, name: str, columns: list[str], wanted: str):
        super().__init__(name, columns)
        self.wanted = wanted

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's part, of all its systems; may be collective."""
        result: np.ndarray | None = None
        for system in watched.systems:
            if self.wanted in system.settings.extra_quantities:
                self.reduction, values = system.measure(self.wanted)
                values = np.atleast_1d(values)
                result = values if result is None else _JOIN[self.reduction](result, values)
        if result is None:
            raise KeyError(self.wanted)
        return result
