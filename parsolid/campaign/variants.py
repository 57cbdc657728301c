"""Variants of a scene for its error bars: coarser ones, the coarsest also with half the step or a looser solver."""

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
# default ratios of the spacing by dimension, from cheap to costly; the first that leave enough particles are taken
RATIOS = {
    1: ((1.5, 2.25),),
    2: ((1.9, 3.6), (1.6, 2.56), (1.5, 2.25)),
    3: ((1.9, 3.2), (1.6, 2.5), (1.5, 2.25)),
}
# default ratios of scenes with meshes, which need a few elements across their parts
RATIOS_OF_MESHES = (1.5, 2.25)
# smallest ratio of a coarse run, and of the ratios of two consecutive runs
_LEAST_RATIO, _NEXT_RATIO = 1.15, 1.25
# fewest intervals along a direction of the coarsest run with the first ratios: of tlsph, and of other methods
_ENOUGH, _ENOUGH_ELSEWHERE = {"tlsph": 2}, 12
# factor on the tolerance of the looser solver
LOOSER = 100.0


@dataclass(frozen=True)
class Variant:
    """A variant of a scene; purpose: SPACING, STEP or SOLVER; ratio: its spacing over that of the original scene."""

    scene: Scene
    purpose: str
    ratio: float

    @property
    def lattices(self) -> str:
        """Its numbers of particles in words."""
        return lattice_words(self.scene)

    @property
    def title(self) -> str:
        """The name in progress messages."""
        special = {SPACING: "", STEP: ", half the step", SOLVER: f", tolerance x {LOOSER:g}"}[self.purpose]
        return f"{self.lattices}{special}"

    @property
    def digest(self) -> str:
        """Digest of all that the results depend on."""
        return digest_of(self.scene)


def digest_of(scene: Scene, ranks: int | None = None) -> str:
    """Twelve hexadecimal digits of a scene, the files it reads, the sources of the package and the number of ranks."""
    paths = {
        step.path for state in scene.initial if state.results for field in state.of_results for step in field.steps
    }
    # results of previous runs are large: their size and time stand for their contents
    results = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in sorted(paths)]
    text = json.dumps([contents(scene), results, ranks, source_digest()], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def level_of(scene: Scene, ratio: float, more_than: float = 0.0) -> Level:
    """The scene with a ratio of the spacing near the given one, below 1 for a finer one. Raises NotCoarsened."""
    if ratio == 1.0:
        return Level(without_error_tables(scene), 1.0)
    return coarsen(scene, ratio, more_than)


def coarse_scenes(scene: Scene, ratios: Iterable[float]) -> tuple[list[Level], list[str]]:
    """The coarser scenes of rising ratios that can be made, and the reasons why others cannot."""
    levels: list[Level] = []
    refused: list[str] = []
    for ratio in ratios:
        try:
            levels.append(coarsen(scene, ratio, _NEXT_RATIO * levels[-1].ratio if levels else _LEAST_RATIO))
        except NotCoarsened as reason:
            refused.append(str(reason))
    return levels, list(dict.fromkeys(refused))


def coarse_variants(scene: Scene, trust_code: bool, ratios: Iterable[float] = ()) -> tuple[list[Variant], list[str]]:
    """The variants for the error bars of a scene, coarsest first, and the reasons why others cannot be made."""
    levels, refused = coarse_scenes(scene, tuple(ratios) or default_ratios(scene))
    variants: list[Variant] = []
    for level in reversed(levels):
        tables = history_only(scene, level.tables, level.ratio)
        purposes = [(SPACING, tables)]
        if level is levels[-1]:
            # steps that follow the spacing have their error in the differences of the spacings
            if step_is_stated(scene):
                purposes.append((STEP, half_step(tables)))
            looser: dict[str, Any] = json.loads(json.dumps(tables))
            solvers = [m["solution"] for m in methods_of(looser) if "tolerance" in m.get("solution", {})]
            for solver in solvers:
                solver["tolerance"] = min(0.5, LOOSER * solver["tolerance"])
            if solvers:
                purposes.append((SOLVER, looser))
        for purpose, changed in purposes:
            variants.append(Variant(parsed(changed, trust_code, level.ratio), purpose, level.ratio))
    return variants, refused


def default_ratios(scene: Scene) -> tuple[float, ...]:
    """Ratios of the spacing if none are requested: the widest that leave enough particles along every direction."""
    if has_meshes(scene):
        return RATIOS_OF_MESHES
    wide, *narrow = RATIOS[scene.dimension]
    if not narrow:
        return wide
    levels = coarse_scenes(scene, wide)[0]
    if len(levels) == len(wide) and all(_has_enough_particles(scene, level) for level in levels):
        return wide
    return next((ratios for ratios in narrow if len(coarse_scenes(scene, ratios)[0]) == len(ratios)), narrow[0])


def _has_enough_particles(scene: Scene, level: Level) -> bool:
    kinds = {number: system.settings.kind for system in scene.systems for number in system.bodies}
    for lattice in lattices_of(scene):
        least = _ENOUGH.get(kinds[lattice.number], _ENOUGH_ELSEWHERE)
        particles = level.tables["bodies"][lattice.number]["particles"]
        if any(count - end < min(least, n) for n, count, end in zip(lattice.intervals, particles, lattice.ends)):
            return False
    return True


def history_only(scene: Scene, tables: dict[str, Any], ratio: float) -> dict[str, Any]:
    """Tables of a variant that writes a history and no other results; its rows are as dense as the scene's."""
    output = {"pictures": False, "fields_times": [], "checkpoint_wall": scene.output.checkpoint_wall}
    if tables["output"].get("history_steps") is not None:
        output["history_steps"] = max(1, int(tables["output"]["history_steps"] / ratio))
    else:
        output["history_interval"] = tables["output"].get("history_interval") or scene.end_time / 200.0
    changed = {key: table for key, table in tables.items() if key not in ("errors", "run")} | {"output": output}
    if not scene.loads.manufactured:
        # a manufactured load is computed from the reference
        changed.pop("reference", None)
    return changed


def half_step(tables: dict[str, Any]) -> dict[str, Any]:
    """The tables with half the time step."""
    changed: dict[str, Any] = json.loads(json.dumps(tables))
    for method in methods_of(changed):
        solution = method.get("solution", {})
        for table, keys in (
            (method, ("cfl", "safety", "maximum_step")),
            (solution, ("safety", "damage_safety", "step")),
        ):
            table |= {key: 0.5 * table[key] for key in keys if table.get(key) is not None}
    return changed
