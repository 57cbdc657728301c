"""The list of what the tests check, docs/tests.md: one line a test function, with the sets that it is in."""

from collections import defaultdict

HEAD = """# Tests

What is checked, by room, and where it runs; a test compares this list with the tests that there are. Made by
`python -m pytest --collect-only -q --properties=docs/tests.md`.

| set | command | what it is |
|---|---|---|
| all | `python -m pytest -n 2 --dist loadfile` | every test but the long ones, on one rank |
| fast | `python -m pytest -n 2 -m "not slow"` | for daily work |
| mpi | `mpirun -n 2 python -m pytest -q -m "mpi and not verification"` | tests in which ranks talk to each other |
| mpi, whole | `mpirun -n 2 python -m pytest -q -m mpi` | the same, and whole runs against exact solutions |
| mpi, on three | `mpirun -n 3 python -m pytest -q -m "mpi and not slow"` | the same on three, but for whole runs |
| verification | `python -m pytest -n 2 -m verification` | against exact solutions, other codes, published results |
| long | `--long` added to any of them | tests that take minutes; those of several ranks on 2 and 3, all sets |

The README's test command runs `all` and both `mpi`; `.ci/run` adds format, lint and types, and checkpoints and restarts
on another MPI. A test that uses the communicator of all ranks (the fixtures `comm` and `shared_path`) is in `mpi` by
itself; `serial` takes it out. What makes the exchanges between ranks (`decomposition`, `particles`) runs on 2 ranks and
on 3. What stands on them runs on one of the two: `contact`, `mixed`, `mpm`, `output`, `pairs`, `solvers`, `tlsph` and
`ulsph`, but for slow tests, on 3, all others on 2. A test with more than two parameter sets runs every other one on
several ranks; where exchanges are made, those that are left on 2 run on 3. A test marked `every_other`, whose parameter
sets take seconds or kernels each, does so on one rank, too, but each value of each parameter runs there. `--long` runs
all. Tests of `end_to_end` start their own ranks, up to 4. Compiled kernels are kept in the user's cache folder,
one for all processes, ranks and checkouts: a process that needs a kernel which another one compiles waits for it.
"""
_SETS = ("slow", "mpi", "verification", "long")


def list_of_properties(items) -> str:
    """Markdown: a section a file of tests, a line a test function with its number of cases and its sets."""
    files = defaultdict(lambda: defaultdict(list))
    for item in items:
        files[item.path.relative_to(item.config.rootpath / "tests"), item.module.__doc__][item.originalname].append(
            item
        )
    parts = [HEAD]
    for (path, about), functions in sorted(files.items(), key=lambda pair: str(pair[0])):
        parts.append(f"\n## {path}\n\n{' '.join(about.strip().partition(chr(10) * 2)[0].split())}\n")
        for name, cases in functions.items():
            found = [kind for kind in _SETS if any(item.get_closest_marker(kind) for item in cases)]
            many = f" ({len(cases)})" if len(cases) > 1 else ""
            parts.append(
                f"- {name.removeprefix('test_').replace('_', ' ')}{many}{': ' * bool(found)}{', '.join(found)}"
            )
    return "\n".join(parts) + "\n"
