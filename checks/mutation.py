"""python -m checks.mutation [PACKAGE...] --number 10: places of the program changed at random, and whether tests fail.

A mutant changes one place: an operator, a comparison, a number by 1 %, a sign, `min` for `max`, a statement left out.
The tests of its file (`TESTS`) run with it in a copy of the program, in a child of a process that has loaded numba and
MPI once. Most run with kernels in Python mode (NUMBA_DISABLE_JIT); where kernels are compiled, those of modules that do
not use the changed file are kept from one mutant to the next. A mutant that is not caught is printed with its line;
status 1 when there was one. `--at FILE:LINE` tries all mutants of one line.
"""

import argparse
import ast
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from parsolid.kernel_cache import WITHOUT_KERNELS

ROOT = Path(__file__).parents[1]
PLAIN, COMPILED = "kernels in Python mode", "compiled kernels"
COPIED = ("parsolid", "decomposition", "tests", "checks", "runs", "examples", "docs", "benchmarks")


def _in(folder: str, *names: str) -> str:
    """Files of tests; FileNotFoundError where one is not there, as pytest then fails and every mutant seems caught."""
    paths = [f"tests/{folder}/test_{name}.py" for name in names]
    for path in paths:
        (ROOT / path).stat()
    return " ".join(paths)


# without those of its time, which are for compiled kernels
_DIRECTORY = " ".join(
    f"tests/decomposition/test_box_directory.py::test_{name}"
    for name in ("the_directory_finds_the_ranks_that_a_table_of_all_does", "close_boxes_have_a_keeper_in_common")
)
_FIELDS = _in("output", "checkpoint", "fields")
_PROBES = _in("simulation", "probes", "regions", "samplers", "shown_fields") + " " + _in("boundary", "reactions")
_RESTART = _in("simulation", "scene_changes", "restart") + " " + _in("output", "damage")
_MESHES = _in("scene", "mesh", "mesh_files", "named_regions") + " " + _in("particles", "meshes_on_ranks")
_SCENES = (
    _in("contracts", "bad_input")
    + " "
    + _in("scene", "all_faults", "faults", "schema", "mpm", "peridynamics", "generation", "named_regions", "bond")
)
_LAWS = _in("materials", "isochoric_laws", "registry", "hyperelastic", "fibres", "prony", "relaxation")
_FLOW = _in("materials", "flow_stress", "micro_inertia", "registry")
# file or folder -> how kernels run and the tests, those that catch most first; the longest name that fits counts
TESTS: dict[str, tuple[str, str]] = {
    "decomposition/bisection.py": (PLAIN, _in("decomposition", "bisection", "ends", "grid")),
    "decomposition/boxes.py": (PLAIN, _in("decomposition", "boxes", "pair_search")),
    "decomposition/grid.py": (PLAIN, _in("decomposition", "grid")),
    "decomposition/halo.py": (PLAIN, _in("decomposition", "halo") + " " + _DIRECTORY),
    "decomposition/migration.py": (PLAIN, _in("decomposition", "migration", "ends")),
    "decomposition/occupied.py": (PLAIN, _in("decomposition", "grid")),
    "decomposition/pair_search.py": (PLAIN, _in("decomposition", "pair_search")),
    "decomposition/plan.py": (PLAIN, _in("decomposition", "plan", "halo", "migration")),
    "decomposition/reduction.py": (PLAIN, _in("decomposition", "reduction")),
    "decomposition/shared_nodes.py": (COMPILED, _in("mpm", "sums_by_hand", "mpm_ranks")),
    "decomposition/slices.py": (PLAIN, _in("decomposition", "slices")),
    "parsolid/api": (COMPILED, _in("commands", "check_advice", "forecast") + " " + _in("api", "python_results")),
    "parsolid/boundary": (
        PLAIN,
        _in("boundary", "conditions", "kinds", "images", "reactions", "loads_on_planes", "slides"),
    ),
    "parsolid/campaign": (
        PLAIN,
        _in("campaign", "estimate", "comparison", "coarsening", "pareto", "study"),
    ),
    **dict.fromkeys(
        [f"parsolid/campaign/{name}.py" for name in ("error_bars", "in_process", "records", "targets", "variants")],
        (COMPILED, _in("campaign", "estimate", "coarsening", "study", "bars_of_runs", "meshes_made_anew")),
    ),
    "parsolid/campaign/pictures.py": (PLAIN, _in("campaign", "pictures")),
    "parsolid/campaign/report.py": (PLAIN, _in("campaign", "verification")),
    "parsolid/campaign/verification.py": (PLAIN, _in("campaign", "verification")),
    "parsolid/commands/keys.py": (PLAIN, _in("commands", "keys", "command_words")),
    "parsolid/commands/plot": (COMPILED, _in("commands", "plot", "plot_forces", "cut_meshes")),
    "parsolid/commands/point.py": (PLAIN, _in("commands", "point")),
    "parsolid/contact": (
        PLAIN,
        _in("contact", "linear_weights", "contact_law", "friction_never_gives", "contact_scene"),
    ),
    "parsolid/contact/broad_phase.py": (PLAIN, _in("contact", "contact_lists")),
    "parsolid/contact/trials.py": (COMPILED, _in("tlsph", "static_contact")),
    "parsolid/contact/ties.py": (COMPILED, _in("mixed", "ties")),
    "parsolid/contact/tie_points.py": (COMPILED, _in("mixed", "ties")),
    "parsolid/contact/tools/contact.py": (COMPILED, _in("tools", "free_tools", "first_touch", "tool_tables")),
    "parsolid/contact/tools": (COMPILED, _in("tools", "rigid_body", "tool_forces", "tool_tables")),
    "parsolid/exact": (
        PLAIN,
        _in("exact", "heat", "manufactured", "micro_solutions", "shock", "viscoelastic_solutions"),
    ),
    "parsolid/materials/damage": (COMPILED, _in("materials", "fracture", "registry")),
    "parsolid/materials/failure": (PLAIN, _in("materials", "failure_laws")),
    "parsolid/materials/hyperelastic": (PLAIN, _LAWS),
    "parsolid/materials/plastic": (PLAIN, _FLOW),
    "parsolid/materials/viscoelastic": (PLAIN, _in("materials", "prony", "relaxation", "registry", "interconversion")),
    "parsolid/methods/mpm": (PLAIN, _in("mpm", "grid_transfers", "grid_weights", "sums_by_hand", "transfers")),
    "parsolid/methods/mpm/conditions.py": (COMPILED, _in("mpm", "mpm_heat", "driven_planes")),
    "parsolid/methods/mpm/contact_normals.py": (COMPILED, _in("mixed", "grid_contact")),
    "parsolid/methods/mpm/nodal_contact.py": (COMPILED, _in("mixed", "grid_contact")),
    "parsolid/methods/mpm/elastic_plastic.py": (COMPILED, _in("mpm", "plastic_update", "failed_points", "hot_start")),
    "parsolid/methods/mpm/energies.py": (COMPILED, _in("mpm", "contact_energy", "own_spin", "sums_by_hand")),
    "parsolid/methods/mpm/points.py": (
        PLAIN,
        _in("mpm", "heat_laws", "grid_transfers", "sums_by_hand"),
    ),
    "parsolid/methods/mpm/heat.py": (PLAIN, _in("mpm", "mpm_heat", "grid_heat")),
    "parsolid/methods/peridynamics": (PLAIN, _in("peridynamics", "bond_forces", "patch", "fragments")),
    "parsolid/methods/tlsph": (PLAIN, _in("tlsph", "point_update", "clamp_edges", "time_step", "reference_force")),
    "parsolid/methods/tlsph/updated_reference.py": (COMPILED, _in("tlsph", "updated_reference")),
    "parsolid/methods/tlsph/mesh_bodies.py": (COMPILED, _in("tlsph", "mesh_weights")),
    "parsolid/methods/ulsph/deletion.py": (COMPILED, _in("contact", "deleted_particles")),
    "parsolid/methods/ulsph": (PLAIN, _in("ulsph", "adjoint", "viscous_heat")),
    "parsolid/observables": (PLAIN, _PROBES),
    "parsolid/output": (PLAIN, _FIELDS),
    "parsolid/output/checkpoint.py": (PLAIN, _in("output", "checkpoint", "damage")),
    "parsolid/output/run_folder.py": (PLAIN, _in("output", "directory")),
    "parsolid/output/fields.py": (PLAIN, _in("output", "field_sums", "fields")),
    "parsolid/output/history.py": (PLAIN, _in("output", "history")),
    "parsolid/output/lock.py": (PLAIN, _in("output", "lock")),
    "parsolid/output/progress.py": (PLAIN, _in("output", "progress")),
    "parsolid/output/results.py": (COMPILED, _in("api", "python_results")),
    "parsolid/output/summary.py": (PLAIN, _in("output", "summary")),
    "parsolid/pairs": (PLAIN, _in("pairs", "pair_list", "smoothing", "verlet_list")),
    "parsolid/pairs/box_on_rank.py": (PLAIN, _in("pairs", "box_sweeps")),
    "parsolid/pairs/box_planes.py": (PLAIN, _in("pairs", "box_sweeps")),
    "parsolid/pairs/box_sweeps.py": (PLAIN, _in("pairs", "box_sweeps")),
    "parsolid/pairs/box_stable_step.py": (COMPILED, _in("tlsph", "box_stable_step")),
    "parsolid/pairs/box_weights.py": (PLAIN, _in("pairs", "box_weights", "box_sweeps")),
    "parsolid/pairs/lattice_convolution.py": (COMPILED, _in("pairs", "lattice_convolution")),
    "parsolid/particles": (
        PLAIN,
        _in("particles", "container", "extents", "machine") + " " + _in("scene", "overlap", "generation"),
    ),
    "parsolid/particles/fillings.py": (PLAIN, _in("scene", "perforated")),
    "parsolid/particles/meshes": (PLAIN, _MESHES),
    "parsolid/point": (
        PLAIN,
        _in("commands", "point_plastic", "point_micro_inertia", "point_viscoelastic", "point"),
    ),
    "parsolid/scene": (PLAIN, _SCENES),
    "parsolid/scene/declared.py": (PLAIN, "tests/examples/test_examples.py " + _SCENES),
    "parsolid/scene/formula_terms.py": (PLAIN, _in("scene", "formulas", "time_functions")),
    "parsolid/scene/csv_tables.py": (PLAIN, _in("scene", "csv_table")),
    "parsolid/scene/formulas.py": (PLAIN, _in("scene", "formulas", "time_functions")),
    "parsolid/scene/load_histories.py": (PLAIN, _in("scene", "time_functions", "csv_table")),
    "parsolid/simulation": (PLAIN, _in("simulation", "step_lengths", "outputs", "phases", "momentum_balance")),
    "parsolid/simulation/energy_check.py": (COMPILED, _in("simulation", "energy_check", "momentum_balance")),
    "parsolid/simulation/field_output.py": (COMPILED, _in("simulation", "error_indicator")),
    "parsolid/simulation/ledger.py": (PLAIN, _in("simulation", "ledger")),
    "parsolid/simulation/history.py": (PLAIN, _PROBES),
    "parsolid/simulation/reference.py": (PLAIN, _in("scene", "reference_series")),
    "parsolid/simulation/representation.py": (COMPILED, _in("simulation", "representation")),
    "parsolid/simulation/restart.py": (COMPILED, _RESTART),
    "parsolid/simulation/scene_changes.py": (PLAIN, _RESTART),
    "parsolid/solvers": (PLAIN, _in("solvers", "solvers", "newton", "eigenmodes", "grid_levels")),
    "parsolid/splines.py": (PLAIN, _in("simulation", "splines")),
    "parsolid/tensors.py": (PLAIN, _in("kernels", "tensors")),
    "parsolid/elementary.py": (COMPILED, _in("kernels", "elementary")),
}


# --- mutants --------------------------------------------------------------------------------------------------------


class Mutant(NamedTuple):
    """Characters start..end of a file of the program, replaced by others."""

    file: str
    line: int
    start: int
    end: int
    new: str


_TEXTS = "Add + -,Sub - +,Mult * /,Div / *,Pow ** *,FloorDiv // *,Mod % *,BitAnd & |,BitOr | &"
_TEXTS += (
    ",Lt < >=,LtE <= >,Gt > <=,GtE >= <,Eq == !=,NotEq != ==,In in not_in,NotIn not_in in,Is is is_not,IsNot is_not is"
)
# operator -> what it is written as and what is put there
_OPERATORS: dict[type, tuple[str, str]] = {
    getattr(ast, name): (old.replace("_", " "), new.replace("_", " "))
    for name, old, new in map(str.split, _TEXTS.split(","))
}
_EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
# a change of numbers beyond these by 1 % is none: round-off, and "never"
_LEAST, _MOST = 1e-6, 1e8


@cache
def text_of(file: str) -> str:
    """As it was when it was first asked for."""
    return (ROOT / file).read_text()


def mutants_of(file: str) -> list[Mutant]:
    """All mutants of a file, in its order."""
    text = text_of(file)
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int, column: int) -> int:
        # columns of `ast` are bytes
        whole = text[starts[line - 1] : starts[line]].encode()
        return starts[line - 1] + len(whole[:column].decode())

    found = []
    for first, last, new in _changes(ast.parse(text)):
        start, end = place(*first), place(*last)
        if isinstance(new, tuple):
            at = text.find(new[0], start, end)
            if at < 0:
                continue
            start, end, new = at, at + len(new[0]), new[1]
        if text[start:end] != new:
            found.append(Mutant(file, text.count("\n", 0, start) + 1, start, end, new))
    return sorted(set(found))


def _changes(tree: ast.AST) -> Iterator[tuple]:
    """(first and last place, what is put there, or what is replaced there by what)."""
    for node in _mutable(tree):
        whole = _place(node) if hasattr(node, "lineno") else ()
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS and not _is_text(node.left, node.right):
            yield _end(node.left), _begin(node.right), _OPERATORS[type(node.op)]
        elif isinstance(node, ast.AugAssign) and type(node.op) in _OPERATORS and not _is_text(node.value):
            yield _end(node.target), _begin(node.value), _OPERATORS[type(node.op)]
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for left, right, operation in zip(sides, sides[1:], node.ops):
                yield _end(left), _begin(right), _OPERATORS[type(operation)]
        elif isinstance(node, ast.BoolOp):
            words = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
            yield _end(node.values[0]), _begin(node.values[1]), words
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            yield whole[0], _begin(node.operand), ("-", "") if isinstance(node.op, ast.USub) else ("not ", "")
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            yield *whole, str(not node.value)
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            yield from ((*whole, new) for new in _other(node.value))
        elif isinstance(node, ast.Call) and (name := _called(node.func)) in _EXTREMES:
            yield *_place(node.func), (name, _EXTREMES[name])
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield *whole, "pass"
        elif isinstance(node, ast.If | ast.While | ast.IfExp) and isinstance(node.test, ast.Name | ast.Attribute):
            yield *_place(node.test), f"(not {ast.unparse(node.test)})"


def _mutable(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes but those of annotations, texts, messages of errors and sizes of buffers."""
    if isinstance(node, ast.Call) and _called(node.func) == "empty":
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ("annotation", "returns") and not isinstance(value, ast.Raise | ast.JoinedStr):
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not isinstance(child, ast.Raise | ast.JoinedStr | ast.Assert):
                    yield from _mutable(child)


def _begin(node: ast.AST) -> tuple[int, int]:
    return node.lineno, node.col_offset


def _end(node: ast.AST) -> tuple[int, int]:
    return node.end_lineno, node.end_col_offset


def _place(node: ast.AST) -> tuple[tuple[int, int], tuple[int, int]]:
    return _begin(node), _end(node)


def _called(function: ast.AST) -> str:
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _is_text(*nodes: ast.AST) -> bool:
    """Whether one is a text, or a union of types."""
    return any(
        isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | None))
        for node in nodes
    )


def _other(value: float) -> list[str]:
    if isinstance(value, int):
        return [str(value + 1)]
    if value == 0.0:
        return ["0.01"]
    return [repr(1.01 * value)] if _LEAST <= abs(value) <= _MOST else []


def mutated(mutant: Mutant) -> tuple[str, str, str]:
    """The text of the file with the change; the changed line before and after."""
    text = text_of(mutant.file)
    new = text[: mutant.start] + mutant.new + text[mutant.end :]
    before, after = (whole.splitlines()[mutant.line - 1].strip() for whole in (text, new))
    return new, before, after


# --- tests of a mutant ----------------------------------------------------------------------------------------------


def tests_of(file: str) -> tuple[str, str] | None:
    """How kernels run in the tests of a file, and the tests: of the longest name in `TESTS` that fits."""
    fitting = [name for name in TESTS if file == name or file.startswith(name.rstrip("/") + "/")]
    return TESTS[max(fitting, key=len)] if fitting else None


def modules() -> dict[str, set[str]]:
    """Every module of the program with the modules that it imports, anywhere in it."""
    files = [path for package in ("parsolid", "decomposition") for path in (ROOT / package).rglob("*.py")]
    names = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in files}
    known, result = set(names.values()), {}
    for path, name in names.items():
        imported = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                imported |= {one.name for one in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                imported |= {node.module} | {f"{node.module}.{one.name}" for one in node.names}
        result[name] = imported & known
    return result


def users_of(file: str) -> set[str]:
    """Modules whose kernels may have code of a file in them."""
    imports, name = modules(), ".".join(Path(file).with_suffix("").parts).removesuffix(".__init__")
    # kernels take functions of laws by the law's type
    law = "parsolid.materials."
    found = {name} | ({module for module in imports if module.startswith(law)} if name.startswith(law) else set())
    while more := {module for module, used in imports.items() if used & found} - found:
        found |= more
    return found


class Copy:
    """A copy of the program in a folder, with kernels of its own."""

    def __init__(self, folder: Path):
        self.folder, self.kernels = folder, folder / "kernels"
        for part in COPIED:
            shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("results", "__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", folder)

    def passes(self, tests: str, longest: float) -> bool | None:
        """Whether tests pass in a child of this process; None when they do not end."""
        child = os.fork()
        if child == 0:
            self._test(tests)
        end = time.monotonic() + longest
        while time.monotonic() < end:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status == 0
            time.sleep(0.02)
        os.killpg(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return None

    def _test(self, tests: str) -> None:
        """Of the child: run tests and end."""
        os.setsid()
        report = os.open(self.folder / "report.txt", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        for stream in (0, 1, 2):
            os.dup2(report, stream)
        os.chdir(self.folder)
        sys.path[:0] = [str(self.folder)]
        os.environ |= {"PYTHONPATH": str(self.folder), "NUMBA_CACHE_DIR": str(self.kernels)}
        # those of the copy
        for name in [name for name in sys.modules if name.startswith(("parsolid", "decomposition"))]:
            del sys.modules[name]
        from mpi4py import MPI

        MPI.Init_thread()
        if "NUMBA_DISABLE_JIT" not in os.environ:
            from parsolid import kernel_cache

            # one name whatever the sources: what a change makes out of date is removed by `with_change`
            kernel_cache.source_digest = lambda: "mutants"
        import pytest

        words = ["-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", "-W", "ignore"]
        os._exit(int(pytest.main([*words, *tests.split()])))

    def with_change(self, mutant: Mutant, text: str, tests: str, longest: float) -> bool | None:
        """Whether tests pass with another text of a file; None when they do not end."""
        path, kept = self.folder / mutant.file, self.kernels.with_name("kept")
        has_kernels = Path(mutant.file).parts[1] not in WITHOUT_KERNELS
        users = users_of(mutant.file) if has_kernels else set()
        if self.kernels.exists():
            shutil.copytree(self.kernels, kept, copy_function=os.link)
            for kernel in self.kernels.rglob("*.nb[ci]"):
                if kernel.name.split("-")[1] in users:
                    kernel.unlink()
        path.write_text(text)
        self._forget(path)
        try:
            alive = self.passes(tests, longest)
            shared = alive and mutant.file.startswith("decomposition")
            return all(self._passes_together(tests, ranks) for ranks in (3, 2)) if shared else alive
        finally:
            path.write_text(text_of(mutant.file))
            self._forget(path)
            shutil.rmtree(self.kernels, ignore_errors=True)
            if kept.exists():
                kept.rename(self.kernels)

    def _passes_together(self, tests: str, ranks: int) -> bool:
        """Whether tests pass on several ranks, for what one rank alone leaves out."""
        beside = Path(sys.executable).with_name("mpirun")
        words = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "mpi and not slow", *tests.split()]
        command = [str(beside) if beside.exists() else "mpirun", "-n", str(ranks), sys.executable, *words]
        environment = os.environ | {"PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            ended = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, timeout=300.0)
        except subprocess.TimeoutExpired:
            return False
        return ended.returncode == 0

    @staticmethod
    def _forget(path: Path) -> None:
        """Byte code is as good as its source's time and length, which may be the same."""
        for old in path.parent.glob(f"__pycache__/{path.stem}.*.pyc"):
            old.unlink()


def load() -> None:
    """What every child would import; MPI is started by each."""
    import mpi4py

    mpi4py.rc.initialize = False
    import h5py  # noqa: F401
    import hypothesis  # noqa: F401
    import meshio  # noqa: F401
    import numba  # noqa: F401
    import pandas  # noqa: F401
    import pydantic  # noqa: F401
    import pytest  # noqa: F401
    import rich.console  # noqa: F401
    import scipy.spatial  # noqa: F401
    import tomli_w  # noqa: F401
    from mpi4py import MPI  # noqa: F401

    sys.dont_write_bytecode = True


def attack(chosen: list[Mutant]) -> int:
    """Try mutants whose tests run in the mode of this process; how many survived."""
    load()
    longest: dict[str, float] = {}
    survived = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for mutant in chosen:
            _, tests = tests_of(mutant.file)
            if tests not in longest:
                began = time.monotonic()
                sound = copy.passes(tests, 600.0)
                longest[tests] = 30.0 + 10.0 * (time.monotonic() - began) if sound else 0.0
                if not sound:
                    report = (copy.folder / "report.txt").read_text()
                    print(f"{tests} do not pass without a change:\n{report[-2000:]}", flush=True)
            if not longest[tests]:
                continue
            began = time.monotonic()
            text, before, after = mutated(mutant)
            alive = copy.with_change(mutant, text, tests, longest[tests])
            survived += bool(alive)
            word = "SURVIVES" if alive else "hangs" if alive is None else "caught"
            seconds = time.monotonic() - began
            print(f"{word:<9} {seconds:5.1f} s  {mutant.file}:{mutant.line}: {before} -> {after}", flush=True)
    return survived


# --- the draw -------------------------------------------------------------------------------------------------------


def packages() -> dict[str, list[str]]:
    """Files with tests by package: two levels of the program, three of the methods."""
    found: dict[str, list[str]] = {}
    for path in sorted(path for package in ("parsolid", "decomposition") for path in (ROOT / package).rglob("*.py")):
        file = str(path.relative_to(ROOT))
        depth = 3 if file.startswith("parsolid/methods/") else 2 if file.startswith("parsolid/") else 1
        if tests_of(file) is not None:
            found.setdefault("/".join(Path(file).parent.parts[:depth]), []).append(file)
    return found


def drawn(files: list[str], number: int, chance: random.Random) -> list[Mutant]:
    """So many mutants, each place as likely as any other."""
    places = [mutant for file in files for mutant in mutants_of(file)]
    return sorted(chance.sample(places, min(number, len(places))))


def main() -> int:
    """Mutants of each mode of kernels in a process of its own."""
    parser = argparse.ArgumentParser(prog="python -m checks.mutation", description=__doc__)
    parser.add_argument("packages", nargs="*", help="such as parsolid/contact; all unless given")
    parser.add_argument("--number", type=int, default=10, help="mutants a package")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at", metavar="FILE:LINE", action="append", default=[], help="all mutants of one line")
    parser.add_argument("--mode", choices=(PLAIN, COMPILED), help=argparse.SUPPRESS)
    options = parser.parse_args()
    chosen = [mutant for at in options.at for mutant in mutants_of(at.split(":")[0]) if at.endswith(f":{mutant.line}")]
    for package, files in packages().items() if not options.at else ():
        if not options.packages or package in options.packages:
            chosen += drawn(files, options.number, random.Random(f"{options.seed} {package}"))
    if options.mode:
        return min(1, attack([mutant for mutant in chosen if tests_of(mutant.file)[0] == options.mode]))
    status = 0
    for mode in sorted({tests_of(mutant.file)[0] for mutant in chosen}):
        environment = os.environ | ({"NUMBA_DISABLE_JIT": "1"} if mode == PLAIN else {})
        command = [sys.executable, "-m", "checks.mutation", *sys.argv[1:], "--mode", mode]
        status |= subprocess.run(command, env=environment).returncode
    return status


if __name__ == "__main__":
    sys.exit(main())
