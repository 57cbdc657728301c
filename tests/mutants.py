"""python -m tests.mutants [WORD...]: change one place of the program at a time and see the tests that guard it fail.

Each entry: file, what stands there, what is put in its place, the tests that have to fail. With words, only the entries
whose file or text has one of them. The program that is changed is a copy. Status 1 when a mutant survives.
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.mutation import ROOT, load, passes, with_change

CHECKPOINT, DAMAGE = "tests/output/test_checkpoint.py", "tests/output/test_damage.py"
CHANGES, LOCK = "tests/simulation/test_scene_changes.py", "tests/output/test_lock.py"
SPACE = "tests/scene/test_overlap.py"
MUTANTS = [
    ("parsolid/output/checkpoint.py", "(partial_name(path), path, previous_name(path))",
     "(path, partial_name(path), previous_name(path))", DAMAGE),
    ("parsolid/output/checkpoint.py", "(partial_name(path), path, previous_name(path))",
     "(partial_name(path), previous_name(path), path)", DAMAGE),
    ("parsolid/output/directory.py", "path.resolve() in read", "path in read", "tests/output/test_directory.py"),
    ("parsolid/output/history.py", "int(row[0]) <= at_step", "int(row[0]) < at_step", "tests/output/test_history.py"),
    ("parsolid/output/fields.py", "times[times <= self._resume_at]", "times[times < self._resume_at]",
     "tests/output/test_fields.py"),
    ("parsolid/output/slabs.py", "if status.Get_elements(MPI.BYTE) != part.nbytes:", "if False:", CHECKPOINT),
    ("decomposition/bisection.py", "(weights[i] + 1) // 2 <= target[p]", "weights[i] // 2 <= target[p]",
     "tests/decomposition/test_bisection.py"),
    ("parsolid/materials/viscoelastic/prony.py", "/ (K + 4.0 / 3.0 * G)", "/ (K + 2.0 / 3.0 * G)",
     "tests/materials/test_prony.py"),
    ("parsolid/observables/twist.py", "self.angle += (", "self.angle = (", "tests/simulation/test_probes.py"),
    ("parsolid/simulation/energy_check.py", "self.limits.balance_limit * measure", "20.0 * measure",
     "tests/simulation/test_energy_check.py"),
    ("parsolid/output/checksums.py", "np.uint64((place + start) * int(_PLACE) % 2**64)", "np.uint64(start)", DAMAGE),
    ("parsolid/output/checksums.py", "    if wrong:", "    if False:", DAMAGE),
    ("parsolid/output/checksums.py", "if digest(text) == stated[\"header\"]", "if True", DAMAGE),
    ("parsolid/output/checksums.py", "[list(item.shape), item.dtype.str]", "[list(item.shape), item.dtype.str[1:]]",
     DAMAGE),
    ("parsolid/output/checkpoint.py", "sums |= {f\"ranks/{numbered('offset', i)}\"",
     "{f\"ranks/{numbered('offset', i)}\"", DAMAGE),
    ("parsolid/output/checkpoint.py", "{\"ranks/values\": _part(comm, values, 0)}", "{}", DAMAGE),
    ("parsolid/output/checkpoint.py", "elif version != VERSION:", "elif version > VERSION:", DAMAGE),
    ("parsolid/output/checkpoint.py", "elif complete != 1:", "elif complete is None:", CHECKPOINT),
    ("parsolid/output/checkpoint.py", "        os.replace(path, previous_name(path))", "        pass", CHECKPOINT),
    ("parsolid/output/lock.py", "os.fstat(descriptor).st_ino == os.stat(self.path).st_ino", "True", LOCK),
    ("parsolid/output/lock.py", "fcntl.LOCK_EX | fcntl.LOCK_NB", "fcntl.LOCK_SH | fcntl.LOCK_NB", LOCK),
    ("parsolid/output/lock.py", "owner.get(\"job\") != mine[\"job\"]", "True", LOCK),
    ("parsolid/output/lock.py", "return error.errno != errno.ESRCH", "return True", LOCK),
    ("parsolid/output/lock.py", "            os.unlink(self.path)", "            pass", LOCK),
    ("parsolid/output/directory.py", "    \"pictures\",\n", "", "tests/output/test_directory.py"),
    ("parsolid/simulation/scene_changes.py", "row[0] <= time", "row[0] < 0.0", CHANGES),
    ("parsolid/simulation/scene_changes.py", "    return found[0] == found[1]", "    return True", CHANGES),
    ("parsolid/simulation/scene_changes.py", "not fixed and (change.rule", "(change.rule", CHANGES),
    ("parsolid/simulation/scene_changes.py", "(key for key in now if key not in before)", "()", CHANGES),
    ("parsolid/simulation/scene_changes.py", "(content {digest(file.read_bytes())})", "", CHANGES),
    ("parsolid/particles/overlap.py", "_ROUND_OFF, _JITTER = 1e-6, 0.5", "_ROUND_OFF, _JITTER = 1e-6, 0.0", SPACE),
    ("parsolid/particles/overlap.py", "_ROUND_OFF, _JITTER = 1e-6", "_ROUND_OFF, _JITTER = -1e-6", SPACE),
    ("parsolid/scene/inside.py", "(turned > slack) & ", "", SPACE),
    ("parsolid/scene/inside.py", "(turned < end - begin - slack)", "True", SPACE),
    ("parsolid/scene/inside.py", "        inside &= from_base[:, i] > margin", "        pass", SPACE),
    ("parsolid/scene/inside.py", " & (_distance(places, box.centre) > box.radius + margin)", "", SPACE),
    ("parsolid/particles/meshes/topology.py", "        if total:", "        if False:", "tests/scene/test_mesh.py"),
    ("parsolid/particles/meshes/topology.py", "keys += of_nodes[column]", "keys = of_nodes[column]",
     "tests/scene/test_mesh.py"),
    ("parsolid/particles/meshes/files.py", "(cells < 0) | (cells >= count)", "(cells < 0) | (cells > 10**6)",
     "tests/scene/test_mesh.py"),
    ("parsolid/scene/formulas.py", "        if np.iscomplexobj(values):", "        if False:",
     "tests/scene/test_formulas.py"),
    ("parsolid/simulation/reference.py", "    if not common.any():", "    if False:",
     "tests/scene/test_reference_series.py"),
    ("parsolid/simulation/probes.py", "joined, lowest = sign * lowest[:count], lowest[count:]",
     "joined, lowest = lowest[:count], lowest[count:]",
     "tests/simulation/test_systems.py tests/simulation/test_probes.py"),
]  # fmt: skip


def survives(copy: Path, file: str, old: str, new: str, tests: str) -> bool:
    """Whether the tests pass with the change."""
    path = copy / file
    text = path.read_text()
    assert text.count(old) >= 1, f"{file}: expected {old!r}, found none"
    alive = with_change(copy, file, text.replace(old, new, 1), tests, 600.0)
    path.write_text(text)
    return bool(alive)


def main(words: list[str]) -> int:
    """Try the mutants; prints one line for each."""
    chosen = [one for one in MUTANTS if not words or any(word in " ".join(one) for word in words)]
    survivors = 0
    load()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in ("parsolid", "decomposition", "tests", "runs", "examples"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("results"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        for tests in dict.fromkeys(one[3] for one in chosen):
            assert passes(copy, tests, 600.0), f"{tests} fail without a change"
        for file, old, new, tests in chosen:
            began = time.monotonic()
            alive = survives(copy, file, old, new, tests)
            survivors += alive
            word = "SURVIVES" if alive else "caught"
            change = f"{file}: {old.strip()[:60]} -> {new.strip()[:40]}"
            print(f"{word:<9} {time.monotonic() - began:5.1f} s  {change}", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} caught")
    return int(survivors > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
