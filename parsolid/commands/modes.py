"""`parsolid modes`: frequencies and shapes of the vibrations of a scene's bodies."""

from pathlib import Path
from typing import Any

from parsolid.commands.arguments import OVERRIDE, TRUST_CODE, code, whole_number
from parsolid.exit_status import DONE, WENT_WRONG


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("scene", metavar="SCENE", help="TOML file")
    parser.add_argument(
        "-n", type=whole_number, default=10, dest="count", metavar="N", help="elastic modes (default 10)"
    )
    output = "folder of the tables, shapes and pictures (default: output.directory of the scene)"
    parser.add_argument("-o", "--output", metavar="DIR", help=output)
    parser.add_argument("--set", action="append", default=[], metavar="KEY.PATH=VALUE", help=OVERRIDE)
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("--pictures", action="store_true", help="also draw each shape")
    silence = "leave out the note of this code; may be repeated"
    parser.add_argument("--silence", action="append", default=[], type=code, metavar="CODE", help=silence)
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")


def run_modes(comm: Any, options: Any) -> int:
    """Find modes, write and print them; the exit status. Collective."""
    from parsolid.api.modes import find_modes, rows_of
    from parsolid.api.scenes import scene_on_all_ranks
    from parsolid.output.log import print_line
    from parsolid.scene import load_scene

    scene = scene_on_all_ranks(comm, lambda: load_scene(options.scene, options.set, options.trust_code))
    folder = Path(options.output or scene.output.directory)
    found = find_modes(comm, scene, options.count, folder, inputs=(options.scene,))
    if comm.rank == 0 and not options.quiet:
        for note in (one for one in found.notes if one.code not in options.silence):
            print_line(str(note))
        _show(rows_of(found), scene.dimension)
        print_line(
            f"{found.particles} particles, {found.iterations} iterations, {found.products} products, "
            f"{found.seconds:.3g} s; shapes in {folder}"
        )
    if options.pictures:
        from parsolid.commands.plot.command import draw_modes
        from parsolid.simulation.warmup import wait_quietly

        if comm.rank == 0:
            draw_modes(folder, found.frequencies, found.rigid)
        wait_quietly(comm)
    if not found.converged:
        if comm.rank == 0:
            print_line(f"not converged after {found.iterations} iterations: see the residuals")
        return WENT_WRONG
    return DONE


def _show(rows: list[dict[str, Any]], dimension: int) -> None:
    """Print the table of modes."""
    from parsolid.commands.arguments import show_table

    axes = "xyz"[:dimension]
    shown = [
        [
            one["mode"],
            "rigid" if one["kind"] == "rigid" else f"{one['frequency']:.6g}",
            "" if one["kind"] == "rigid" else f"{one['residual']:.1e}",
            *(f"{100.0 * one[f'share_{axis}']:.1f}" for axis in axes),
        ]
        for one in rows
    ]
    show_table("modes", ["mode", "frequency [Hz]", "residual", *(f"mass {axis} [%]" for axis in axes)], shown)
