"""The command `keys`: what a scene may say, as text, as JSON Schema for editors, and as a scene to start from."""

from typing import Any


def add_arguments(parser: Any) -> None:
    """Give the arguments of `keys` to an argparse parser."""
    path = "only this key or table, such as bodies.material or method.tlsph.smoothing"
    parser.add_argument("path", nargs="?", default="", metavar="PATH", help=path)
    json = "print JSON Schema instead, for editors that complete and check TOML"
    parser.add_argument("--json", action="store_true", help=json)
    new = "write a commented scene of this method to start from instead"
    parser.add_argument("--new", metavar="METHOD", help=new)
    parser.add_argument("-o", "--output", metavar="FILE", help="with --new: a free name (default scene.toml)")


def run_keys(comm: Any, options: Any) -> int:
    """Print keys with meaning, unit, default and bounds, or what is asked for instead; exit status 0. Collective.

    Raises SolverError on all ranks for a path of no key, a method that is not there, a file that is, or for words that
    exclude each other.
    """
    from parsolid.collective import SolverError

    words = [word for word in ("path", "json", "new") if getattr(options, word)]
    if len(words) > 1 or (options.output and options.new is None):
        found = f"{len(words)} of them" if len(words) > 1 else "-o without --new"
        raise SolverError(f"keys: expected PATH, --json or --new METHOD [-o FILE], found {found}")
    if options.new is not None:
        from parsolid.commands.keys.starting import write_scene

        write_scene(comm, options.new, options.output or "scene.toml")
    elif options.json:
        import json

        from parsolid.commands.keys.description import scene_schema

        if comm.rank == 0:
            print(json.dumps(scene_schema(), indent=1), flush=True)
    else:
        from parsolid.commands.keys.listing import listing

        text = listing(options.path)
        if comm.rank == 0:
            print(text, flush=True)
    return 0
