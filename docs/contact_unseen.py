"""Balances of scenes in contact that no setting was chosen by: python docs/contact_unseen.py [words of a name].

Every method is as it is unless its name says otherwise ("stages" is total-Lagrangian SPH as it is). Told are the
largest imbalance, what the scheme gave, and what of linear and angular momentum was lost where nothing holds bodies.
"""

import sys
from typing import Any

import numpy as np
from contact_tables import BONDS, LEAPFROG, SPEED, Tables, block, material, run, scene

STAGES = {"kind": "tlsph"}
KINDS: dict[str, Tables] = {"leapfrog": LEAPFROG, "stages": STAGES, "peridynamics": BONDS, "ulsph": {"kind": "ulsph"}}
METAL = {
    "kind": "elastic-plastic",
    "density": 1.0,
    "youngs_modulus": 1.0,
    "poissons_ratio": 0.3,
    "specific_heat": 1.0,
    "taylor_quinney": 0.9,
    "flow_stress": {"kind": "linear-hardening", "yield_stress": 1e3, "hardening": 0.0},
}


def law(kind: str) -> Tables:
    """The same solid as a method takes it."""
    laws = {"ulsph": METAL, "peridynamics": material(kind="linear-elastic")}
    return laws.get(kind, material())


def with_methods(tables: Tables, kinds: list[str], spacing: float) -> Tables:
    """Bodies of methods of these names, each with the law that its method takes."""
    known = KINDS | {"mpm": {"kind": "mpm", "cell": 2.0 * spacing}}
    for body, kind in zip(tables["bodies"], kinds):
        body |= {"method": kind, "material": law(kind)}
    names = list(dict.fromkeys(kinds))
    tables["methods"] = [known[kind] | {"name": kind} for kind in names]
    del tables["method"]
    return tables


def oblique(one: str, other: str, friction: float = 0.3, n: int = 12) -> Tables:
    """Two discs that meet off their centres at 8 % of the speed of waves."""
    bodies = [
        {"name": name, "shape": {"sphere": {"centre": centre, "radius": 0.5}}, "particles": [n, n]}
        | {"velocity": [sign * 0.04 * SPEED, 0.0], "placement": "cells"}
        for name, centre, sign in (("left", [-0.53, -0.2], 1.0), ("right", [0.53, 0.2], -1.0))
    ]
    return with_methods(scene(bodies, 4.0 / SPEED, {"friction": friction}), [one, other], 1.0 / n)


def fold(method: Tables) -> Tables:
    """A horseshoe whose ends are driven together, over and along each other."""
    shape = {"cylindrical_shell": {"centre": [0, 0], "radius": 1.0, "thickness": 0.24, "angles": [10, 350]}}
    body = {"name": "shoe", "shape": shape, "particles": [84, 4], "placement": "cells", "material": material()}
    driven = "where(X > 0, X*X, 0)"
    body["velocity"] = [f"-{0.1 * SPEED}*{driven}", f"-{0.3 * SPEED}*Y*{driven}"]
    return scene([body], 4.0 / SPEED, {"friction": 0.2}, method=method)


def stack(kinds: list[str]) -> Tables:
    """Blocks of several methods, one spacing off and apart, that fall on one another and on a floor."""
    h = 0.125
    bodies = [
        block(str(k), [0.2 * k, 1.05 * k], [0.2 * k + 1.0, 1.05 * k + 1.0], h, "cells", velocity=[0.0, -0.03 * SPEED])
        for k in range(len(kinds))
    ]
    floor = {"name": "floor", "shape": {"plane": {"point": [0, -0.03], "normal": [0, 1]}}, "friction": 0.4}
    tables = scene(bodies, 8.0 / SPEED, {"friction": 0.4}, loads={"acceleration": [0, -2e-3]}, tools=[floor])
    return with_methods(tables, kinds, h)


def stroke(kind: str) -> Tables:
    """A cylinder strokes a block that lies on a plane, down and along and up again."""
    h = 0.1
    body = block("block", [-1.5, 0.0], [1.5, 1.0], h, "cells")
    path = [f"{0.02 * SPEED}", f"-{0.06 * SPEED}*cos(2*pi*t/{8.0 / SPEED})"]
    tools = [
        {"name": "finger", "shape": {"sphere": {"centre": [-0.4, 1.42], "radius": 0.4}}, "motion": {"velocity": path}},
        {"name": "anvil", "shape": {"plane": {"point": [0, 0], "normal": [0, 1]}}},
    ]
    tables = scene([body], 6.0 / SPEED, tools=[one | {"friction": 0.3} for one in tools])
    return with_methods({name: value for name, value in tables.items() if name != "contact"}, [kind], h)


def three(kinds: list[str]) -> Tables:
    """Three cubes of several methods that meet in space off their centres, with friction, at a fifth of the speed of
    waves."""
    h, v = 0.2, 0.1 * SPEED
    corners = {"a": ([-1.03, 0.0, 0.0], [v, 0, 0]), "b": ([0.0, 0.15, 0.1], [-v, 0, 0])}
    corners["c"] = ([-0.5, 1.19, 0.15], [0.0, -v, 0.0])
    bodies = [
        block(name, low, [x + 1.0 for x in low], h, "cells", velocity=one) for name, (low, one) in corners.items()
    ]
    return with_methods(scene(bodies, 2.0 / SPEED, {"friction": 0.3}), kinds, h)


def fast(kind: str, speed: float) -> Tables:
    """A block thrown at another one with a part of the speed of waves, three spacings away, with friction."""
    h = 1.0 / 16
    left = block("left", [-1.19, 0.1], [-0.19, 0.6], h, "cells", velocity=[speed * SPEED, 0.1 * SPEED])
    right = block("right", [0.0, 0.0], [0.5, 1.0], h, "cells")
    return with_methods(scene([left, right], 1.5 / SPEED, {"friction": 0.3}), [kind, kind], h)


def cases() -> dict[str, Tables]:
    """By name."""
    pairs = [("leapfrog", "mpm"), ("peridynamics", "ulsph"), ("stages", "peridynamics"), ("ulsph", "mpm")]
    alone = ("leapfrog", "stages", "peridynamics", "ulsph", "mpm")
    pairs += [(kind, kind) for kind in alone]
    result = {f"oblique discs, {one} and {other}": oblique(one, other) for one, other in pairs}
    result |= {f"fold on itself, {kind}": fold(KINDS[kind]) for kind in ("leapfrog", "stages")}
    towers = [["leapfrog", "mpm", "peridynamics"], ["stages", "ulsph", "stages"], ["peridynamics"] * 2, ["stages"] * 2]
    result |= {f"stack, {', '.join(kinds)}": stack(kinds) for kinds in towers}
    result |= {f"stroke of a tool, {kind}": stroke(kind) for kind in alone}
    cubes = (["leapfrog", "ulsph", "mpm"], ["stages", "peridynamics", "leapfrog"])
    result |= {f"three in space, {', '.join(kinds)}": three(kinds) for kinds in cubes}
    speeds = [(kind, 0.8) for kind in alone] + [("peridynamics", speed) for speed in (0.4, 0.5, 1.2)]
    result |= {f"closing at {speed} c, {kind}": fast(kind, speed) for kind, speed in speeds}
    return result


def momentum(simulation: Any) -> Tables:
    """Momentum and angular momentum of all bodies about the origin, in the plane."""
    total = np.zeros(3)
    for system in simulation.systems:
        owned = system.particles.owned_rows
        p = owned("velocity") * (system.mass[: system.owned] * system.share[: system.owned])[:, None]
        if "impulse" in system.particles:
            p = p + owned("impulse")
        x = owned("position")
        total += [*p[:, :2].sum(axis=0), float((x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]).sum())]
    return {"momentum": total}


def main() -> None:
    """A line for each case."""
    for name, tables in cases().items():
        if sys.argv[1:] and not any(word in name for word in sys.argv[1:]):
            continue
        simulation, columns = run(tables, momentum)
        balance, change = simulation.energy_check, np.abs(columns["momentum"] - columns["momentum"][0]).max(axis=0)
        kinetic = columns["kinetic"][0]
        free = "tools" not in tables and kinetic > 0.0
        kept = f", momentum to {change[:2].max():.0e}, angular {change[2]:.0e}" if free else ""
        print(
            f"{name}: {simulation.clock.step} steps, balance {balance.worst / balance.largest:.1e}, given by the "
            f"scheme {balance.gained / balance.largest:.1e}, friction took "
            f"{columns['friction_dissipation'][-1] / balance.largest:.1e}, least growth "
            f"{np.diff(columns['friction_dissipation']).min() / balance.largest:.0e}{kept}",
            flush=True,
        )


if __name__ == "__main__":
    main()
