"""A bar, plate or block under uniform tension along X: creep and recovery, exact for any Prony series and load history.

Galadima et al., sections 8.1 and 8.2. With operational moduli (Laplace transform times s) the axial strain is
sigma/E = sigma (1/(9K) + 1/(3G)) and the lateral one sigma (1/(9K) - 1/(6G)); in the complete formulation Poisson's
ratio is constant and the lateral strain is -nu times the axial one. Cross-sections are free to contract (bar, plane
stress, 3-D).
"""

from typing import Any

import numpy as np

from parsolid.exact.prony import Compliance, PronySeries
from parsolid.exact.solution import Solution


class UniaxialCreep(Solution):
    """Displacement and stress of a body whose face X = origin[0] only slides, and whose other fixed planes pass through
    origin.

    Of a run are judged, at every row of its history, the displacements of probes that show position and displacement.
    """

    def __init__(self, axial: Compliance, lateral: Compliance, history: Any, origin: Any) -> None:
        """axial, lateral: strains over stress; history: see `Compliance.strain`; origin (d,) [m]: the point
        that rests.
        """
        self.axial, self.lateral, self.history = axial, lateral, [tuple(map(float, knot)) for knot in history]
        self.origin = np.asarray(origin, float)
        self.probes: list[str] = []

    @classmethod
    def of_scene(cls, scene: Any) -> "UniaxialCreep":
        """The solution for a scene's first body, its traction along X, and its supports; what they leave free is
        centred.
        """
        body, dimension = scene.bodies[0], scene.dimension
        traction = next(one for one in scene.boundaries if one.kind == "traction")
        amplitude = float(traction.traction.evaluate(np.zeros((1, dimension)), 0.0)[0, 0])
        rows = traction.history.table if traction.history is not None else [[0.0, 1.0]]
        history = [(time, amplitude * factor) for time, factor in rows]
        box = body.shape.model
        origin = 0.5 * (np.array(box.lower) + np.array(box.upper))
        for one in scene.boundaries:
            if one.kind in ("fixed", "roller"):
                origin[one.plane.axis] = one.plane.offset
        if body.material.bulk == "elastic":
            known = body.material.equilibrium
            result = cls.deviatoric(PronySeries.shear_of(body.material), known.bulk_modulus, history, origin)
        else:
            series, ratio = PronySeries.youngs_of(body.material), body.material.equilibrium.poissons_ratio
            result = cls.complete(series, ratio, history, origin)
        wanted = {"position", "displacement"}
        result.probes = [probe.name for probe in scene.probes if probe.at is not None and wanted <= set(probe.fields)]
        return result

    @classmethod
    def complete(cls, modulus: PronySeries, poissons_ratio: float, history: Any, origin: Any) -> "UniaxialCreep":
        """All moduli relax alike: Young's modulus E(t) and a constant Poisson's ratio."""
        axial = modulus.compliance()
        return cls(axial, axial.combined(0.0, -poissons_ratio), history, origin)

    @classmethod
    def deviatoric(cls, shear: PronySeries, bulk_modulus: float, history: Any, origin: Any) -> "UniaxialCreep":
        """Only the shear modulus G(t) relaxes; bulk modulus [Pa]."""
        inverse, volumetric = shear.compliance(), 1.0 / (9.0 * bulk_modulus)
        return cls(inverse.combined(volumetric, 1.0 / 3.0), inverse.combined(volumetric, -1.0 / 6.0), history, origin)

    def stress(self, time: float) -> float:
        """The stress [Pa] just after a time [s]."""
        passed = [knot for knot in self.history if knot[0] <= time]
        coming = [knot for knot in self.history if knot[0] > time]
        if not passed:
            return 0.0
        (begin, before), (end, after) = passed[-1], coming[0] if coming else (np.inf, passed[-1][1])
        return before + (after - before) * (time - begin) / (end - begin)

    def strains(self, time: float) -> tuple[float, float]:
        """(axial, lateral) strain just after a time [s]."""
        return self.axial.strain(self.history, time), self.lateral.strain(self.history, time)

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """displacement (n, d) [m] and stress (n, d, d) [Pa] at X (n, d) [m], just after a time [s]."""
        n, d = positions.shape
        axial, lateral = self.strains(time)
        displacement = (positions - self.origin[:d]) * np.array([axial, lateral, lateral])[:d]
        stress = np.zeros((n, d, d))
        stress[:, 0, 0] = self.stress(time)
        return {"displacement": displacement, "stress": stress}

    # --- a run's history ----------------------------------------------------------------------------------------

    def _columns(self, field: str) -> list[list[str]]:
        return [[f"{name}.{field}_{axis}" for axis in "xyz"[: len(self.origin)]] for name in self.probes]

    def history_columns(self) -> list[str]:
        """Positions and displacements of the probes."""
        return [
            column for field in ("position", "displacement") for columns in self._columns(field) for column in columns
        ]

    def history_names(self) -> list[str]:
        """The displacements of the probes."""
        return [column for columns in self._columns("displacement") for column in columns]

    def history_errors(self, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Largest |error| of each displacement over its largest exact value, over all rows of the history."""
        # a row at a jump shows what was before, unless it was written after the jump's step of length 0
        jumps = {end for (begin, _), (end, _) in zip(self.history, self.history[1:]) if begin == end} | {
            self.history[0][0]
        }
        times = [
            np.nextafter(time, -np.inf) if time in jumps and (step > 0.0 or row == 0) else time
            for row, (time, step) in enumerate(zip(history["time"], history["dt"]))
        ]
        errors = {}
        for places, columns in zip(self._columns("position"), self._columns("displacement")):
            found = np.stack([history[column] for column in columns], axis=1)
            place = np.stack([history[column] for column in places], axis=1) - found
            exact = np.array([self.fields(at[None, :], time)["displacement"][0] for at, time in zip(place, times)])
            for column, difference, size in zip(columns, (found - exact).T, exact.T):
                largest = np.abs(size).max()
                errors[column] = float(np.abs(difference).max() / (largest if largest > 0.0 else 1.0))
        return errors
