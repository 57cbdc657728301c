"""python -m tests.mutation [ROOM...] --number 40: mutants drawn at random, and whether the tests of their file fail.

Mutants are made by cosmic-ray's operators (`pip install cosmic-ray`), so no hand chooses them. cosmic-ray's own runner
starts the tests anew for each, which loads numba and MPI for seconds; here they are loaded once, and every mutant is
tested in a child of that process, on a copy of the program. Rooms of plain loops run with kernels in Python mode
(`NUMBA_DISABLE_JIT`). A mutant that is not caught is printed with its line; status 1 when there was one.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
OPERATORS = (
    *("ReplaceBinaryOperator_" + one for one in ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Mod_Mul", "Pow_Mul")),
    *("ReplaceBinaryOperator_" + one for one in ("FloorDiv_Mul", "BitAnd_BitOr")),
    *("ReplaceComparisonOperator_" + one for one in ("Eq_NotEq", "NotEq_Eq", "Lt_LtE", "LtE_Lt", "Gt_GtE", "GtE_Gt")),
    *("ReplaceComparisonOperator_" + one for one in ("Lt_Gt", "Gt_Lt", "Is_IsNot", "IsNot_Is")),
    *("ReplaceUnaryOperator_" + one for one in ("USub_UAdd", "Delete_Not")),
    *("AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd"),
    *("ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "NumberReplacer", "ZeroIterationForLoop"),
)
# file or folder -> tests of it; the longest name that fits counts
PLAIN, WHOLE = "plain loops", "kernels"
_RESTART = "tests/simulation/test_restart.py tests/simulation/test_scene_changes.py tests/output/test_damage.py"
_PROBES = (
    "tests/simulation/test_probes.py tests/simulation/test_regions.py tests/simulation/test_samplers.py "
    "tests/simulation/test_shown_fields.py tests/boundary/test_reactions.py"
)
_BALANCE = "tests/simulation/test_energy_check.py"
_LAWS = "tests/materials/test_registry.py tests/materials/test_relaxation.py tests/materials/test_prony.py"
ROOMS: dict[str, tuple[str, dict[str, str]]] = {
    "decomposition": (
        PLAIN,
        {
            f"decomposition/{name}.py": f"tests/decomposition/{tests}"
            for name, tests in {
                "bisection": "test_bisection.py tests/decomposition/test_ends.py tests/decomposition/test_grid.py",
                "plan": "test_plan.py tests/decomposition/test_halo.py tests/decomposition/test_migration.py",
                "migration": "test_migration.py tests/decomposition/test_ends.py",
                "halo": "test_halo.py tests/decomposition/test_box_directory.py",
                "pair_search": "test_pair_search.py",
                "grid": "test_grid.py",
                "occupied": "test_grid.py",
                "reduction": "test_reduction.py",
            }.items()
        },
    ),
    "output": (
        PLAIN,
        {
            "parsolid/output/checkpoint.py": "tests/output/test_checkpoint.py tests/output/test_damage.py",
            "parsolid/output/checksums.py": "tests/output/test_damage.py",
            "parsolid/output/slabs.py": "tests/output/test_checkpoint.py tests/output/test_fields.py",
            "parsolid/output/blocks.py": "tests/output/test_checkpoint.py tests/output/test_fields.py",
            "parsolid/output/numbering.py": "tests/output/test_checkpoint.py tests/output/test_fields.py",
            "parsolid/output/packing.py": "tests/output/test_checkpoint.py tests/output/test_fields.py",
            "parsolid/output/vtkhdf.py": "tests/output/test_fields.py",
            "parsolid/output/fields.py": "tests/output/test_fields.py",
            "parsolid/output/history.py": "tests/output/test_history.py",
            "parsolid/output/directory.py": "tests/output/test_directory.py",
            "parsolid/output/lock.py": "tests/output/test_lock.py",
            "parsolid/output/summary.py": "tests/output/test_summary.py",
            "parsolid/output/progress.py": "tests/output/test_progress.py",
        },
    ),
    "ledger": (
        WHOLE,
        {
            "parsolid/simulation/energy_check.py": _BALANCE,
            "parsolid/simulation/ledger.py": "tests/simulation/test_ledger.py",
        },
    ),
    "restart": (
        WHOLE,
        {"parsolid/simulation/scene_changes.py": _RESTART, "parsolid/simulation/restart.py": _RESTART},
    ),
    "probes": (WHOLE, {"parsolid/simulation/probes.py": _PROBES, "parsolid/observables": _PROBES}),
    "boundary": (WHOLE, {"parsolid/boundary": "tests/boundary"}),
    "laws": (
        WHOLE,
        {
            "parsolid/materials/hyperelastic": "tests/materials/test_registry.py tests/materials/test_hyperelastic.py",
            "parsolid/materials/viscoelastic": _LAWS + " tests/materials/test_interconversion.py",
            "parsolid/materials/plastic": "tests/materials/test_flow_stress.py tests/materials/test_registry.py "
            "tests/materials/test_micro_inertia.py tests/materials/test_micro_inertia_solve.py",
            "parsolid/materials/failure": "tests/materials/test_failure_laws.py",
            "parsolid/materials/damage": "tests/materials/test_fracture.py tests/materials/test_registry.py",
        },
    ),
}


def files_of(tests_of: dict[str, str]) -> dict[str, str]:
    """Every file of a room, and its tests."""
    found = {}
    for place, tests in tests_of.items():
        path = ROOT / place
        files = [path] if path.suffix else sorted(path.glob("*.py"))
        found |= {str(file.relative_to(ROOT)): tests for file in files if file.exists()}
    return found


def drawn(files: dict[str, str], number: int, chance: random.Random) -> list[tuple[str, str, int]]:
    """So many places (file, operator, occurrence), each as likely as any other."""
    from cosmic_ray.plugins import get_operator

    places = []
    for file in files:
        tree = _tree(ROOT / file)
        for name in OPERATORS:
            operator = get_operator(f"core/{name}")()
            count = sum(len([*operator.mutation_positions(node)]) for node in _nodes(tree))
            places += [(file, name, i) for i in range(count)]
    return chance.sample(places, min(number, len(places)))


def _tree(path: Path):
    from cosmic_ray.ast import get_ast_from_path

    return get_ast_from_path(path)


def _nodes(node):
    yield node
    for child in getattr(node, "children", ()):
        yield from _nodes(child)


def mutant(file: str, operator: str, occurrence: int) -> tuple[str, int, str, str]:
    """The mutated text, and the first line that differs: its number, before and after."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    text = (ROOT / file).read_text()
    new = mutate_code(text, get_operator(f"core/{operator}")(), occurrence)
    lines = zip(text.splitlines(), new.splitlines())
    return new, *next((i, a.strip(), b.strip()) for i, (a, b) in enumerate(lines, 1) if a != b)


def passes(copy: Path, tests: str, longest: float) -> bool | None:
    """Whether tests pass in a child of this process; None when they do not end."""
    child = os.fork()
    if child == 0:
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        os.chdir(copy)
        sys.path[:0] = [str(copy)]
        os.environ["PYTHONPATH"] = str(copy)
        from mpi4py import MPI

        MPI.Init_thread()
        import pytest

        os._exit(int(pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", *tests.split()])))
    end = time.monotonic() + longest
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status == 0
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def passes_together(copy: Path, tests: str, ranks: int = 3) -> bool:
    """Whether tests pass on several ranks, each of which loads the program: for what one rank alone leaves out."""
    beside = Path(sys.executable).with_name("mpirun")
    words = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", *tests.split()]
    command = [str(beside) if beside.exists() else "mpirun", "-n", str(ranks), sys.executable, *words]
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        ended = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=300.0)
    except subprocess.TimeoutExpired:
        return False
    return ended.returncode == 0


def with_change(copy: Path, file: str, text: str, tests: str, longest: float) -> bool | None:
    """Whether tests pass with another text of a file, which is left there; None when they do not end."""
    (copy / file).write_text(text)
    # a file of byte code is as good as its source's time and length, which may be the same
    for old in (copy / file).parent.glob(f"__pycache__/{Path(file).stem}.*.pyc"):
        old.unlink()
    return passes(copy, tests, longest)


def attack(copy: Path, files: dict[str, str], chosen: list[tuple[str, str, int]]) -> tuple[int, int]:
    """How many mutants were tried, and how many survived."""
    longest: dict[str, float] = {}
    tried = survived = 0
    for file, operator, occurrence in chosen:
        tests = files[file]
        if tests not in longest:
            began = time.monotonic()
            assert passes(copy, tests, 600.0), f"{tests} fail without a change"
            longest[tests] = 30.0 + 10.0 * (time.monotonic() - began)
        new, line, before, after = mutant(file, operator, occurrence)
        alive = with_change(copy, file, new, tests, longest[tests])
        if alive and file in ROOMS["decomposition"][1]:
            alive = passes_together(copy, tests)
        shutil.copy(ROOT / file, copy / file)
        tried, survived = tried + 1, survived + bool(alive)
        word = "SURVIVES" if alive else "hangs" if alive is None else "caught"
        print(f"{word:<9} {file}:{line}: {before} -> {after}", flush=True)
    return tried, survived


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


def room(name: str, number: int, seed: int) -> int:
    """Mutants of one room; how many survived."""
    load()
    files = files_of(ROOMS[name][1])
    chosen = drawn(files, number, random.Random(f"{seed} {name}"))
    # by file: its tests stay in the caches of the machine
    chosen.sort()
    with tempfile.TemporaryDirectory() as folder:
        for part in ("parsolid", "decomposition", "tests", "runs", "examples", "docs"):
            shutil.copytree(ROOT / part, Path(folder) / part)
        shutil.copy(ROOT / "pyproject.toml", folder)
        tried, survived = attack(Path(folder), files, chosen)
    print(f"{name}: {tried - survived} of {tried} caught (seed {seed})", flush=True)
    return survived


def main() -> int:
    """Each room in a process of its own, for kernels are in Python mode or not."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("rooms", nargs="*", choices=[[], *ROOMS], default=[])
    parser.add_argument("--number", type=int, default=40, help="mutants a room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--here", action="store_true", help="in this process, which has the mode that is needed")
    options = parser.parse_args()
    if options.here:
        return max(int(room(name, options.number, options.seed) > 0) for name in options.rooms)
    status = 0
    for name in options.rooms or ROOMS:
        mode = {"NUMBA_DISABLE_JIT": "1"} if ROOMS[name][0] == PLAIN else {}
        words = [name, "--number", str(options.number), "--seed", str(options.seed), "--here"]
        status |= subprocess.run([sys.executable, "-m", "tests.mutation", *words], env=os.environ | mode).returncode
    return status


if __name__ == "__main__":
    sys.exit(main())
