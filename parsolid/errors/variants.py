"""The runs beside a run: coarser scenes, and a coarse one with half the step or with a solver that stops earlier."""

import hashlib
import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from parsolid.errors.coarsening import Coarser, NotCoarsened, coarser, lattices_of, methods_of, parsed
from parsolid.errors.orders import stepped_by_hand
from parsolid.errors.places import Corners, with_corners
from parsolid.scene import Scene
from parsolid.sources import source_digest

SPACING, STEP, SOLVER = "spacing", "step", "solver"
# ratios of the spacing asked for where the scene names none, by dimension: the time that they take is bounded; the
# second ones where the coarsest would have too few particles with the first, the last where those cannot be made
RATIOS = {
    1: ((1.5, 2.25),),
    2: ((1.9, 3.6), (1.6, 2.56), (1.5, 2.25)),
    3: ((1.9, 3.2), (1.6, 2.5), (1.5, 2.25)),
}
# fewest intervals along every direction of the coarsest with the first ones
ENOUGH = {"tlsph": 2}
_ENOUGH = 12
# of what a solver stops at
LOOSER = 100.0


@dataclass(frozen=True)
class Companion:
    """A scene to be run beside another one: what it is for, its ratio of spacings, its particles in words, and those
    that it watches around probes.
    """

    scene: Scene
    purpose: str
    ratio: float
    lattices: str
    corners: tuple[Corners, ...] = ()

    @property
    def title(self) -> str:
        """What the progress calls it."""
        special = {SPACING: "", STEP: ", half the step", SOLVER: f", tolerance x {LOOSER:g}"}[self.purpose]
        return f"{self.lattices}{special}"

    @property
    def digest(self) -> str:
        """Twelve hexadecimal digits of all that its numbers depend on."""
        text = json.dumps([self.scene.resolved(), source_digest()], sort_keys=True)
        found = hashlib.sha256(text.encode())
        for file in self.scene_files():
            found.update(Path(file).read_bytes())
        return found.hexdigest()[:12]

    def scene_files(self) -> list[str]:
        """Files that the scene reads and whose contents are no part of its tables."""
        from parsolid.scene.declared import law_files

        return law_files(self.scene)


def companions_of(scene: Scene, trust_code: bool, ratios: Iterable[float] = ()) -> tuple[list[Companion], list[str]]:
    """Companions, coarsest first, and why others cannot be: in words for the user."""
    found: list[Companion] = []
    refused: list[str] = []
    last, asked = 1.15, tuple(ratios) or usual_ratios(scene)
    coarse: dict[str, Any] | None = None
    corners: tuple[Corners, ...] = ()
    for wanted in asked:
        try:
            made = coarser(scene, wanted, last)
        except NotCoarsened as reason:
            refused += [str(reason)] if str(reason) not in refused else []
            continue
        # the next one is coarser again by a share that tells something
        last, coarse = 1.25 * made.ratio, quieter(scene, made.tables, made.ratio)
        coarse, corners = with_corners(scene, parsed(made.tables, trust_code), coarse)
        found.insert(0, Companion(parsed(coarse, trust_code), SPACING, made.ratio, made.lattices, corners))
    if coarse is not None:
        one = found[0]
        if stepped_by_hand(scene):
            # elsewhere steps follow the spacing, and their error is in the differences of the spacings
            found.insert(1, Companion(parsed(half_step(coarse), trust_code), STEP, one.ratio, one.lattices, corners))
        looser = looser_solver(coarse)
        if looser is not None:
            stopped = parsed(looser, trust_code)
            found.insert(2, Companion(stopped, SOLVER, one.ratio, one.lattices, corners))
    return found, refused


def usual_ratios(scene: Scene) -> tuple[float, ...]:
    """Ratios of the spacing where none are asked for: the widest that leave enough particles along every direction."""
    wide, *narrow = RATIOS[scene.dimension]
    if not narrow or all(_is_enough(scene, made) for made in _coarser(scene, wide)):
        return wide
    return next((ratios for ratios in narrow if None not in _coarser(scene, ratios)), narrow[0])


def _coarser(scene: Scene, ratios: tuple[float, ...]) -> list[Coarser | None]:
    """The coarser scenes of all ratios, None in the place of one that cannot be."""
    found: list[Coarser | None] = []
    last = 1.15
    for wanted in ratios:
        made = None
        with suppress(NotCoarsened):
            made = coarser(scene, wanted, last)
            last = 1.25 * made.ratio
        found.append(made)
    return found


def _is_enough(scene: Scene, made: Coarser | None) -> bool:
    if made is None:
        return False
    kinds = {number: system.settings.kind for system in scene.systems for number in system.bodies}
    for one in lattices_of(scene):
        least, particles = ENOUGH.get(kinds[one.number], _ENOUGH), made.tables["bodies"][one.number]["particles"]
        if any(now - end < min(least, n) for n, now, end in zip(one.intervals, particles, one.ends)):
            return False
    return True


def quieter(scene: Scene, tables: dict[str, Any], ratio: float) -> dict[str, Any]:
    """Tables of a companion that writes a history and nothing else; its rows are as dense as the scene's."""
    output = tables["output"]
    kept = {"pictures": False, "fields_times": [], "checkpoint_wall": scene.output.checkpoint_wall}
    if output.get("history_steps") is not None:
        kept["history_steps"] = max(1, int(output["history_steps"] / ratio))
    else:
        kept["history_interval"] = output.get("history_interval") or scene.end_time / 200.0
    # a manufactured load is that of the reference
    unwanted = ("output", "errors", "run") if scene.loads.manufactured else ("output", "reference", "errors", "run")
    return {key: part for key, part in tables.items() if key not in unwanted} | {"output": kept}


def half_step(tables: dict[str, Any]) -> dict[str, Any]:
    """The same with half the step, however the method states it."""
    changed: dict[str, Any] = json.loads(json.dumps(tables))
    for method in methods_of(changed):
        solution = method.get("solution", {})
        for table, keys in (
            (method, ("cfl", "safety", "maximum_step")),
            (solution, ("safety", "damage_safety", "step")),
        ):
            table |= {key: 0.5 * table[key] for key in keys if table.get(key) is not None}
    return changed


def looser_solver(tables: dict[str, Any]) -> dict[str, Any] | None:
    """The same with a solver that stops earlier, None where none iterates."""
    changed: dict[str, Any] = json.loads(json.dumps(tables))
    solvers = [m["solution"] for m in methods_of(changed) if "tolerance" in m.get("solution", {})]
    for solver in solvers:
        solver["tolerance"] = min(0.5, LOOSER * solver["tolerance"])
    return changed if solvers else None
