"""The command `import`: a mesh file becomes an HDF5 file of which every rank of a run reads its own part."""

from typing import Any

from parsolid.collective import SolverError
from parsolid.particles.meshes.imported import Contents, import_mesh
from parsolid.scene.validation_errors import SceneError


def add_arguments(parser: Any) -> None:
    """Give the arguments of `import` to an argparse parser."""
    parser.add_argument("mesh", metavar="MESH", help="a mesh file that meshio reads")
    parser.add_argument("target", metavar="FILE.h5", help="a file that is not there yet, for shape = { mesh = ... }")


def run_import(comm: Any, options: Any) -> int:
    """Import a mesh; exit status 0. Collective: rank 0 works. Raises SolverError on all ranks."""
    fault = None
    if comm.rank == 0:
        try:
            contents, arrays = import_mesh(options.mesh, options.target)
            print(f"{options.target}: {_in_words(contents, arrays)}", flush=True)
        except SceneError as error:
            fault = "\n".join(error.faults)
        except OSError as error:
            fault = f"target: expected a file that can be written, found {options.target} ({error.strerror or error})"
    fault = comm.bcast(fault)
    if fault is not None:
        raise SolverError(fault)
    return 0


def _in_words(contents: Contents, arrays: Any) -> str:
    elements: dict[str, int] = {}
    for b, kind in enumerate(contents.kinds):
        elements[kind] = elements.get(kind, 0) + len(arrays[f"elements/{b}"])
    told = ", ".join(f"{count:,} {kind}" for kind, count in elements.items())
    groups = sorted({*contents.nodes, *contents.elements, *(name for name, _ in contents.facets)})
    named = ", ".join(map(repr, groups)) or "none"
    return f"{len(arrays['points']):,} nodes, {told} in {contents.dimension}-D; groups: {named}"
