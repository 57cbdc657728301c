"""Scenes beside a scene: coarser ones, a coarse one with half the step or with a solver that stops earlier."""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from parsolid.campaign.coarsening import (
    Level,
    NotCoarsened,
    coarsen,
    lattice_words,
    lattices_of,
    methods_of,
    parsed,
    without_error_tables,
)
from parsolid.campaign.orders import has_meshes, step_is_stated
from parsolid.scene import Scene
from parsolid.simulation.scene_changes import contents
from parsolid.sources import source_digest

SPACING, STEP, SOLVER = "spacing", "step", "solver"
# ratios of the spacing where the scene names none, by dimension: the time that they take is bounded; the second ones
# where the coarsest would have too few particles with the first, the last where those cannot be made
RATIOS = {
    1: ((1.5, 2.25),),
    2: ((1.9, 3.6), (1.6, 2.56), (1.5, 2.25)),
    3: ((1.9, 3.2), (1.6, 2.5), (1.5, 2.25)),
}
# where bodies are meshes, which need a few elements across their parts
RATIOS_OF_MESHES = (1.5, 2.25)
# least ratio of a coarse run, and of the next one over it: a share that tells something
_LEAST_RATIO, _NEXT_RATIO = 1.15, 1.25
# fewest intervals along every direction of the coarsest with the first ratios
_ENOUGH, _ENOUGH_ELSEWHERE = {"tlsph": 2}, 12
# of the tolerance that a solver stops at
LOOSER = 100.0


@dataclass(frozen=True)
class Variant:
    """A scene beside another one: what it is for, the spacing over that of the other, its particles in words."""

    scene: Scene
    purpose: str
    ratio: float
    lattices: str

    @property
    def title(self) -> str:
        """What the progress calls it."""
        special = {SPACING: "", STEP: ", half the step", SOLVER: f", tolerance x {LOOSER:g}"}[self.purpose]
        return f"{self.lattices}{special}"

    @property
    def digest(self) -> str:
        """Of all that its numbers depend on."""
        return digest_of(self.scene)


def digest_of(scene: Scene, ranks: int | None = None) -> str:
    """Twelve hexadecimal digits of a scene, the contents of the files it reads, the sources and the ranks."""
    taken = {one.path for state in scene.initial if state.results for field in state.of_results for one in field.steps}
    # files of results are large: when they were written says as much as what is in them
    results = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in sorted(taken)]
    text = json.dumps([contents(scene), results, ranks, source_digest()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def level_of(scene: Scene, ratio: float, more_than: float = 0.0) -> Level:
    """The scene nearest to a ratio of the spacing, below 1 for a finer one. Raises NotCoarsened."""
    if ratio == 1.0:
        return Level(without_error_tables(scene), 1.0, lattice_words(scene))
    return coarsen(scene, ratio, more_than)


def coarse_scenes(scene: Scene, ratios: Iterable[float]) -> tuple[list[Level], list[str]]:
    """The scenes of rising ratios that can be made, and why others cannot."""
    found: list[Level] = []
    refused: list[str] = []
    for ratio in ratios:
        try:
            found.append(coarsen(scene, ratio, _NEXT_RATIO * found[-1].ratio if found else _LEAST_RATIO))
        except NotCoarsened as reason:
            refused.append(str(reason))
    return found, list(dict.fromkeys(refused))


def coarse_variants(scene: Scene, trust_code: bool, ratios: Iterable[float] = ()) -> tuple[list[Variant], list[str]]:
    """The variants that the error bars of a scene need, coarsest first, and why others cannot be: in words."""
    made, refused = coarse_scenes(scene, tuple(ratios) or usual_ratios(scene))
    found: list[Variant] = []
    for number, one in enumerate(reversed(made)):
        tables = history_only(scene, one.tables, one.ratio)
        purposes: list[tuple[str, dict[str, Any] | None]] = [(SPACING, tables)]
        if number == 0:
            # elsewhere steps follow the spacing, and their error is in the differences of the spacings
            purposes.append((STEP, half_step(tables) if step_is_stated(scene) else None))
            # the same with a solver that stops earlier, None where none iterates
            changed: dict[str, Any] = json.loads(json.dumps(tables))
            solvers = [m["solution"] for m in methods_of(changed) if "tolerance" in m.get("solution", {})]
            for solver in solvers:
                solver["tolerance"] = min(0.5, LOOSER * solver["tolerance"])
            purposes.append((SOLVER, changed if solvers else None))
        found += [
            Variant(parsed(changed, trust_code, one.ratio), purpose, one.ratio, one.lattices)
            for purpose, changed in purposes
            if changed is not None
        ]
    return found, refused


def usual_ratios(scene: Scene) -> tuple[float, ...]:
    """Ratios of the spacing where none are requested: the widest that leave enough particles along every direction."""
    if has_meshes(scene):
        return RATIOS_OF_MESHES
    wide, *narrow = RATIOS[scene.dimension]
    if not narrow:
        return wide
    made = coarse_scenes(scene, wide)[0]
    if len(made) == len(wide) and all(_is_enough(scene, one) for one in made):
        return wide
    return next((ratios for ratios in narrow if len(coarse_scenes(scene, ratios)[0]) == len(ratios)), narrow[0])


def _is_enough(scene: Scene, made: Level) -> bool:
    kinds = {number: system.settings.kind for system in scene.systems for number in system.bodies}
    for one in lattices_of(scene):
        least = _ENOUGH.get(kinds[one.number], _ENOUGH_ELSEWHERE)
        particles = made.tables["bodies"][one.number]["particles"]
        if any(now - end < min(least, n) for n, now, end in zip(one.intervals, particles, one.ends)):
            return False
    return True


def history_only(scene: Scene, tables: dict[str, Any], ratio: float) -> dict[str, Any]:
    """Tables of a variant that writes a history and nothing else; its rows are as dense as the scene's."""
    output = tables["output"]
    kept = {"pictures": False, "fields_times": [], "checkpoint_wall": scene.output.checkpoint_wall}
    if output.get("history_steps") is not None:
        kept["history_steps"] = max(1, int(output["history_steps"] / ratio))
    else:
        kept["history_interval"] = output.get("history_interval") or scene.end_time / 200.0
    # a manufactured load is that of the reference
    left_out = ("output", "errors", "run") if scene.loads.manufactured else ("output", "reference", "errors", "run")
    return {key: part for key, part in tables.items() if key not in left_out} | {"output": kept}


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
