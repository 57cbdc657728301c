"""Small scenes by name, and what is promised of each; a contract runs every scene that carries its tag.

Tags: the method ("tlsph", "peridynamics", "mpm", "ulsph"); what a scene has ("branches", "flow", "failure", "deletion",
"cracks", "heat", "contact", "friction", "tie", "tool", "mesh", "static", "stages", "updated", "substeps"); "yields": it
flows in equilibrium; "fields": series of fields are written; "few": fewer particles than ranks; "free": nothing acts
from outside, and momentum is kept; "turns": angular momentum is kept as well; "migrates": particles change their rank.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from contact.meeting import BONDS as FREE_BONDS
from contact.meeting import SPEED as SOFT_SPEED
from contact.meeting import block, discs
from contact.meeting import tables as touching
from contact.test_deleted_particles import hammered
from contact.test_deleted_particles import torn as torn_tie
from materials.test_flow_in_methods import LAWS as FLOWS
from materials.test_flow_in_methods import swinging
from materials.test_mazars import METHODS as CONCRETE_METHODS
from materials.test_mazars import tables as concrete
from mixed.bodies_apart import tables as apart
from mixed.test_balances_in_contact import BONDS, LEAPFROG, LINEAR, POINTS, blocks
from mixed.test_balances_in_contact import RUBBER as CLOSING_RUBBER
from mixed.test_balances_in_contact import apart as closing
from mixed.test_grid_contact import rubbing_copper
from mixed.test_methods_meet import SPEED, bars
from mixed.test_points_keep_rows import flying_bars
from mixed.test_subcycling import tables as substepped
from mixed.tied_blocks import blocks as tied
from mpm.points import crossing
from mpm.points import taylor_bar as taylor_points
from mpm.test_failed_points import torn
from mpm.test_transfers import spinning as spinning_points
from pairs.test_lattice_weights import graded, holed
from peridynamics.test_unlike_series import LAWS as SERIES
from peridynamics.test_unlike_series import TWO, beside, creeping
from peridynamics.test_unlike_series import material as of_series
from small_scenes import SCENES, changed
from solids import COPPER, ONE_BRANCH, RUBBER, SOFT, column, punch, supports, tables
from tlsph.test_implicit import spinning as turning_bar
from tlsph.test_load_history import KINEMATIC, METAL, VISCOUS
from tlsph.test_load_history import pulled as pulled_strip
from tlsph.test_mesh_weights import of_mesh
from tlsph.test_plastic_flow import BRITTLE, KINDS, bent
from tlsph.test_pressures import cook, stiff_block
from tlsph.test_shared_nodes import scene_of, two_groups
from tlsph.test_stages import there_and_back
from tlsph.test_static import sagging
from tlsph.test_static_contact import rubbing
from tlsph.test_static_tools import press, pressed
from tlsph.test_tied_equilibria import pulled as ends_pulled
from tlsph.test_tied_equilibria import tied as two_tied
from tools.test_free_tools import METHODS as TOOLED
from tools.test_free_tools import hit
from ulsph.plates import STEEL, impact
from ulsph.plates import block as cells
from ulsph.plates import scene as flow
from ulsph.test_elastic_plastic import taylor as taylor_flow
from ulsph.test_moving_planes import PRESSED, layer
from ulsph.test_moving_planes import RATE as PISTON

Tables = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """A scene and what is promised of it.

    make: raw tables, given a folder for files; steps: how many, to the end unless given; stops: steps before each
    interruption of a run that is restarted; balance: bound of the energy that is not accounted for, of the largest
    energy; momentum, angular: bounds of what is lost of momenta that are kept, of the sum of their parts; grows:
    columns of the history that reach a ten-thousandth of the largest energy, so that the scene does what it is for;
    agreement: between numbers of ranks, of each column's scale.
    """

    make: Callable[[Path], Tables]
    tags: frozenset[str]
    steps: int | None = None
    stops: tuple[int, ...] = (8,)
    balance: float = 1e-2
    momentum: float = 1e-11
    angular: float = 1e-7
    grows: tuple[str, ...] = ()
    agreement: float = 1e-9


CASES: dict[str, Case] = {}


def add(name: str, tags: str, make: Callable[..., Tables] | Tables, **promised: Any) -> None:
    """Take a scene into the table: raw tables, or a function of a folder that makes them."""
    assert name not in CASES, name
    CASES[name] = Case(make if callable(make) else lambda folder: make, frozenset(tags.split()), **promised)


def cases(*tags: str, without: tuple[str, ...] = ()) -> list[str]:
    """Names of the scenes that carry all these tags and none of those."""
    return [name for name, case in CASES.items() if case.tags.issuperset(tags) and not case.tags & set(without)]


def one_of_each_tag() -> set[str]:
    """Names of the first scene of every tag."""
    return {next(iter(cases(tag))) for tag in {tag for case in CASES.values() for tag in case.tags}}


# --- total-Lagrangian SPH ----------------------------------------------------------------------------------------


def ring() -> Tables:
    """A quarter ring with two mirror planes: particles with their own axes and unequal spacings."""
    shape = {"cylindrical_shell": {"centre": [0.0, 0.0], "radius": 1.0, "thickness": 0.4, "angles": [0.0, 90.0]}}
    data = tables(
        [17, 5],
        material={**RUBBER, "branches": [{"beta": 3.0, "tau": 0.02}]},
        boundaries=supports(X=(0.0, "roller"), Y=(0.0, "roller")),
    )
    data["bodies"][0] |= {"shape": shape, "velocity": ["20*X*Y", "-15*Y"]}
    return data


def pulled(**method) -> Tables:
    """A bar with gravity, a traction, and an end that moves as prescribed."""
    return tables(
        (13, 7),
        [2.0, 1.0],
        material={**RUBBER, "branches": ONE_BRANCH},
        method=method,
        loads={"acceleration": ["0", "-200"]},
        boundaries=[
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "X = 2", "kind": "velocity", "velocity": ["10*sin(500*t)", "free"]},
            {"plane": "Y = 1", "kind": "traction", "traction": ["0", "-1e5*X"]},
        ],
    )


def loaded_mesh(folder) -> Tables:
    """All kinds of elements in one body with a clamp, a roller, a traction and a pressure."""
    return of_mesh(
        folder, "mixed", 3, counts=(6, 3, 3), body={"velocity": ["0.02*Y", "-0.04*X", "0"]}, end_time=3.0,
        boundaries=[
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "Z = 0", "kind": "roller"},
            {"plane": "X = 1.5", "kind": "traction", "traction": ["0.02", "0.01*t", "0"]},
            {"plane": "Y = 0.75", "kind": "pressure", "pressure": "0.01"},
        ],
    )  # fmt: skip


def free_mesh(folder) -> Tables:
    """All kinds of elements in one body that nothing holds, without dissipation."""
    body, method = {"velocity": ["0.1*Y", "-0.2*X", "0"]}, {"dissipation": 0.0}
    return of_mesh(folder, "mixed", 3, body=body, method=method, end_time=5.0)


def struck_mesh(folder) -> Tables:
    """A ball on a mesh, whose particles have unlike masses on springs of contact."""
    shape = {"sphere": {"centre": [1.7, 1.31], "radius": 0.3}}
    tool = {"name": "ball", "shape": shape, "mass": 0.05, "velocity": [0.0, -1.0], "friction": 0.3}
    return of_mesh(folder, "triangle", 2, counts=(8, 4), tools=[tool], method={"mass_scaling": 9.0})


def loaded_groups(folder) -> Tables:
    """Two solids that share the nodes of one mesh."""
    return scene_of(
        two_groups(folder, "mixed", 3), 3, end_time=2.0,
        boundaries=[
            {"plane": "X = 0", "kind": "fixed"},
            {"plane": "Z = 0", "kind": "roller"},
            {"plane": "Y = 0.5", "kind": "traction", "traction": ["0.01", "0.02*t", "0"]},
            {"plane": "X = 1", "kind": "pressure", "pressure": "0.02"},
        ],
    )  # fmt: skip


def held(data: Tables) -> Tables:
    """The body clamped at Y = 0 and in a smooth motion."""
    data["bodies"][0]["velocity"] = ["0.1*Y", "0", "0.1*X*Y"]
    return data | {"boundaries": supports(Y=(0.0, "fixed"))}


def flying(weights: str) -> Tables:
    """A column that nothing holds, without dissipation."""
    data = column((5, 9, 5), method={"weights": weights, "dissipation": 0.0})
    return data | {"boundaries": []}


def spin() -> Tables:
    """A square that turns by more than half a turn."""
    method = LEAPS | {"dissipation": 0.0}
    data = tables((7, 7), material={**SOFT, "branches": ONE_BRANCH}, method=method, end_time=9.0)
    data["bodies"][0]["velocity"] = ["0.3 - (Y - 0.5) + 0.1*X", "X - 0.5"]
    return data


def strip(folder, material) -> Tables:
    """A strip of triangles in equilibrium, which flows or relaxes."""
    data = pulled_strip(folder, material)
    if material is not VISCOUS:
        data["boundaries"][1]["traction"] = ["0.01*t", "0.05*t"]
    return data


def strap(folder) -> Tables:
    """A strap of two meshes that do not match bears a growing load over its tie, in equilibrium and in motion."""
    kinds = ((0.5, "leapfrog"), (0.7, "implicit"))
    stages = [{"start": start, "method": {"integrator": kind}} for start, kind in kinds]
    return two_tied(folder, ends_pulled(["0.04*t", "0.004*t"]), stages=stages)


def between_dies(material=SOFT) -> Tables:
    """A square between two dies, which hold it by friction alone, and which slips."""
    floor = {"name": "floor", "shape": {"plane": {"point": [0.0, 0.0], "normal": [0.0, 1.0]}}, "friction": 0.1}
    data = pressed([press(1.0, "-0.05", friction=0.1), floor], particles=(4, 4), boundaries=supports(X=(0.0, "roller")))
    # the rate of a path is a difference of what is solved for
    data["method"]["tolerance"] = 1e-11
    data["bodies"][0]["material"] = material
    return data


LEAPS = {"integrator": "leapfrog"}
add("punch", "tlsph branches", punch(), steps=60, balance=1e-3)
add("column", "tlsph branches", column(), steps=60, balance=1e-3)
add("ring", "tlsph branches", ring(), steps=60, balance=1e-3)
add("pulled", "tlsph branches", pulled(), steps=60, balance=5e-3)
add("pulled, scaled", "tlsph branches", pulled(**LEAPS, mass_scaling=9.0), steps=20, balance=5e-3)
add("mesh", "tlsph mesh", loaded_mesh, balance=1e-4, stops=(20,))
add("mesh, free", "tlsph mesh free turns", free_mesh, steps=40, stops=(20,), balance=1e-4, angular=1e-12)
add("mesh and tool, scaled", "tlsph mesh tool contact", struck_mesh, steps=20)
add("groups of a mesh", "tlsph mesh", loaded_groups, balance=1e-4, stops=(20,))
add("holed", "tlsph", held(holed(3, dissipation=1.0)), steps=20)
add("graded", "tlsph", held(graded(3, "fourth-order")), steps=20)
closed = changed(punch((13, 13), method={"weights": "closure"}), {"bodies.0.jitter": 0.1})
add("jittered", "tlsph branches", closed, steps=20)
for weights in ("cells", "fourth-order"):
    add(f"flying column, {weights}", "tlsph branches free turns", flying(weights), steps=60, balance=1e-3, angular=2e-5)
for kind in KINDS:
    failure = None if kind == "cells" else BRITTLE
    made = partial(lambda kind, failure, folder: bent(kind, folder, failure), kind, failure)
    method = "peridynamics" if kind.startswith("bonds") else "tlsph"
    grows = ("plastic_work", "failure_dissipation")[: 1 + (failure is not None)]
    bound = 2e-3 if kind == "kernel" else 1e-11
    add(f"bent, {kind}", f"{method} flow", made, steps=60, stops=(12,), balance=bound, grows=grows)
add("free spin", "tlsph branches free turns", spin(), balance=2e-3, angular=1e-12)
add("turning bar, implicit", "tlsph free turns", turning_bar(), stops=(9,), balance=1e-6, agreement=1e-7)
turning_mesh = lambda at: turning_bar(method={"accuracy": 1e-2}, folder=at)  # noqa: E731
add("turning mesh, implicit", "tlsph mesh free turns", turning_mesh, stops=(3,), balance=1e-6, agreement=1e-7)
staged = {"grows": ("stage_change",)}
add("there and back", "tlsph static stages", there_and_back(), stops=(2, 12), balance=2e-4, **staged)
promised = {"stops": (3, 20), "balance": 1e-6} | staged
add("there and back, stiff", "tlsph mesh static stages", lambda at: there_and_back(stiff_block(at)), **promised)
promised = {"stops": (2,), "balance": 1e-3, "grows": ("tie_energy",), "agreement": 1e-7}
add("tied strap", "tlsph mesh tie static stages", strap, **promised)
rubs = {"balance": 1e-3, "grows": ("friction_dissipation",)}
add("between dies", "tlsph static tool contact friction", between_dies(), stops=(3,), **rubs)
flows = rubs | {"grows": ("friction_dissipation", "plastic_work")}
add("flow between dies", "tlsph static tool contact friction yields", between_dies(METAL), stops=(3,), **flows)
add("rubbing squares", "tlsph static contact friction", rubbing(), steps=6, stops=(3, 5), agreement=1e-7, **rubs)
# the rate and curvature of a path are differences of what is solved for
add("cook", "tlsph mesh static", lambda folder: cook(folder, 4, 0.4999), stops=(2,), balance=1e-4, agreement=1e-7)
add("sagging", "tlsph mesh static", sagging, stops=(3,), balance=2e-4, agreement=1e-7)
strips = {"kinematic flow": (KINEMATIC, "plastic_work"), "relaxation": (VISCOUS, "material_dissipation")}
for name, (material, lost) in strips.items():
    made = partial(strip, material=material)
    promised = {"stops": (3,), "agreement": 1e-7, "balance": 1e-4, "grows": (lost,)}
    add(f"strip in {name}", "tlsph mesh static flow", made, **promised)

# --- peridynamics ------------------------------------------------------------------------------------------------

for law in SERIES:
    both = beside(2, of_series(law, [{"ratio": 1.0, "tau": 0.1}]), of_series(law, TWO), jitter=0.0)
    add(f"beside, {law}", "peridynamics branches", both, steps=9, stops=(5,), grows=("material_dissipation",))
add("creeping bars", "peridynamics branches static", creeping(17, 0.4), stops=(3,), balance=1e-6, agreement=1e-6)

# Kalthoff and Winkler's plate on a coarse lattice, hit harder
STEEL_8000 = {"kind": "linear-elastic", "density": 8000.0, "youngs_modulus": 190e9, "poissons_ratio": 0.3}
STRUCK = {"lower": [-0.001, -0.001], "upper": [0.004, 0.025]}
NOTCHED = tables(
    [40, 40],
    [0.1, 0.1],
    material=STEEL_8000,
    body={"placement": "cells"},
    end_time=40e-6,
    method={"kind": "peridynamics", "plane": "strain", "damage": {"fracture_energy": 22130.0}}
    | {"pre_cracks": [{"segment": [[-0.01, 0.025], [0.05, 0.025]]}]},
    boundaries=[
        {"kind": "roller", "plane": "Y = 0"},
        {"kind": "velocity", "box": STRUCK, "velocity": ["25*tanh(t/0.5e-6)", "free"]},
    ],
    probes=[
        {"name": "bonds", "quantity": "broken_bonds"},
        {"name": "corner", "at": [0.1, 0.1], "fields": ["displacement", "damage"]},
    ],
)
# a viscoelastic block in space with a cut through part of it, pulled apart; bonds break by their energy
PRONY = {"kind": "prony", "density": 1000.0, "youngs_modulus": 2e6, "poissons_ratio": 0.3}
CUT = {"plane": "X = 0.5", "box": {"lower": [0.0, -0.1, -0.1], "upper": [1.0, 0.3, 1.1]}}
GRIPPED = {"lower": [0.85, -1.0, -1.0], "upper": [1.1, 2.0, 2.0]}
TORN_BLOCK = tables(
    [10, 8, 6],
    [1.0, 0.8, 0.6],
    material=PRONY | {"terms": [{"ratio": 1.0, "tau": 1e-3}, {"ratio": 0.5, "tau": 1e-2}]},
    body={"placement": "cells"},
    end_time=0.03,
    method={"kind": "peridynamics", "horizon_ratio": 2, "influence": "linear", "pre_cracks": [CUT]}
    | {"damage": {"criterion": "energy", "fracture_energy": 600.0}},
    boundaries=[
        {"kind": "roller", "plane": "X = 0"},
        {"kind": "velocity", "box": GRIPPED, "velocity": ["2*tanh(t/2e-3)", "free", "free"]},
    ],
    probes=[{"name": "bonds", "quantity": "broken_bonds"}],
)
add("notched", "peridynamics cracks", NOTCHED, stops=(100,), balance=3e-3, grows=("fracture_dissipation",))
add(
    "torn block", "peridynamics cracks branches", TORN_BLOCK, stops=(30,), balance=3e-3, grows=("fracture_dissipation",)
)

# --- material points and updated-Lagrangian SPH ------------------------------------------------------------------

for order, transfer in (("musl", "flip"), ("usl", "apic")):
    bar = taylor_points(1.6e-3, order=order, transfer=transfer)
    add(f"taylor, {order}, {transfer}", "mpm flow", bar, steps=60, balance=3e-2, grows=("plastic_work",))
for basis, d in (("linear", 2), ("ugimp", 3), ("cubic-spline", 2)):
    bar = taylor_points(1.6e-3 if d == 3 else 8e-4, dimension=d, length=16e-3, basis=basis, order="usl")
    add(f"taylor, {basis}", "mpm flow", bar, steps=40, balance=7e-2, grows=("plastic_work",))
add("crossing", "mpm free migrates", crossing(), steps=250, stops=(100,), momentum=1e-9)
in_space = crossing(cells=(4, 3, 2), order="musl", transfer="apic")
add("crossing in space", "mpm free migrates", in_space, steps=150, momentum=1e-9)
relaxing_points = crossing(speed=0.0)
relaxing_points["bodies"][0]["material"] |= {"branches": [{"beta": 1.0, "tau": 1e-3}, {"beta": 1.0, "tau": 0.1}]}
promised = {"steps": 60, "stops": (30,), "balance": 5e-3, "momentum": 1e-9, "grows": ("material_dissipation",)}
add("relaxing points", "mpm branches free", relaxing_points, **promised)
turning = spinning_points(transfer="aflip") | {"boundaries": [{"kind": "roller", "plane": "Y = -0.3"}]}
turning["bodies"][0]["velocity"] = ["-20*(Y + 0.3)", "20*X"]
add("turning, aflip", "mpm", turning, steps=60, balance=2e-2)
for name, tags, kind, after in (
    ("points", "mpm failure free", None, "pressure"),
    ("points, deleted", "mpm failure", None, "delete"),
    ("flow, deleted", "ulsph failure", {"kind": "ulsph"}, "delete"),
):
    promised = {"steps": 45, "stops": (3,), "balance": 4e-3, "grows": ("failure_dissipation",)}
    add(f"torn {name}", tags, torn(kind, speed=800.0, after=after), **promised)
UNLIKE = impact(across=7, along=13)
UNLIKE["bodies"][1]["material"] = STEEL | {"density": 7000.0, "shear_modulus": 6e10, "bulk_modulus": 1.2e11}
add("impact of two laws", "ulsph flow free", UNLIKE, steps=40)


def whirling() -> Tables:
    """A square that turns, so that its lists are made anew, and its particles dealt out anew."""
    body = cells([24, 24], [24e-3, 24e-3], velocity=["-6e4*(Y - 0.012)", "6e4*(X - 0.012)"])
    return flow(body, end_time=4e-6, method={"skin": 0.03})


add("whirling", "ulsph flow free migrates", whirling(), stops=(37,))
moving_plane = layer(PRESSED, [f"-{PISTON}*X", f"{0.1 * PISTON}*X"], end_time=8e-7, method={"skin": 0.01})
add("piston", "ulsph", moving_plane, stops=(37,), balance=1e-3)
TISSUE = {
    "kind": "gasser-ogden-holzapfel",
    "density": 1000.0,
    "shear_modulus": 1e6,
    "bulk_modulus": 1e7,
    "fibre_modulus": 1e6,
    "fibre_exponent": 0.8,
    "dispersion": 0.2,
    "fibre": {"angle": "X/0.02"},
    "softening": {"r": 2.0, "m": 1e5},
    "branches": [{"modulus": 1e6, "tau": 1e-4}],
}
turning = cells([20, 20], [0.02, 0.02], TISSUE, velocity=["-2e3*(Y - 0.01) + 500*X", "2e3*(X - 0.01)"])
data = flow(turning, end_time=1.5e-3, method={"skin": 0.03})
promised = {"stops": (60,), "balance": 2e-3, "grows": ("softening_dissipation", "material_dissipation")}
add("whirling tissue", "ulsph branches free migrates", data, **promised)
for d in (2, 3):
    add(f"taylor, ulsph, {d}-D", "ulsph flow heat", taylor_flow(d), steps=60, balance=3e-2, grows=("plastic_work",))
for kind, bound in {"tlsph": 1e-13, "peridynamics": 1e-9, "mpm": 5e-4, "ulsph": 1e-3}.items():
    for law, (material, *_) in FLOWS.items():
        promised = {"steps": 40, "stops": (20,), "balance": bound, "grows": ("plastic_work",)}
        add(f"swinging {law}, {kind}", f"{kind} flow", swinging(kind, material), **promised)
for kind, method in CONCRETE_METHODS.items():
    data = concrete(method | {"balance_limit": 1.0})
    data["bodies"][0] |= {"particles": [9, 9], "jitter": 0.1, "velocity": ["1.5*sin(40*X)", "-0.7*Y"]}
    promised = {"steps": 24, "stops": (12,), "balance": 0.4, "grows": ("softening_dissipation",)}
    add(f"concrete, {kind}", f"{kind} damage", data, **promised)

# --- fewer particles than ranks ------------------------------------------------------------------------------------


def of_two_particles(kind: str) -> Tables:
    """Two particles that approach one another: of three ranks one has none."""
    d, law = (1, "linear-elastic") if kind == "peridynamics" else (2, "neo-hookean")
    keys = {"tlsph": LEAPS, "peridynamics": {"horizon_ratio": 1.5}, "mpm": {"cell": 0.5}, "ulsph": {}}
    body = {"placement": "cells", "velocity": ["-0.1*X", "0"][:d]}
    return tables(
        [2, 1][:d], material=SOFT | {"kind": law}, method={"kind": kind} | keys[kind], body=body, end_time=9.0
    )


for kind in ("tlsph", "peridynamics", "mpm", "ulsph"):
    add(f"two particles, {kind}", f"{kind} few", of_two_particles(kind), steps=12, stops=(5,))

# --- bodies that meet --------------------------------------------------------------------------------------------


def far_apart() -> Tables:
    """Four blocks in a row, of which the first is moved onto the last: their ranks are no neighbours at first."""
    row = [block(name, (2.0 * i, 0.0), (2.0 * i + 1.0, 0.5), (7, 4)) for i, name in enumerate("abcd")]
    row[0] |= {"displacement": ["6.1", "0.51"], "velocity": [0.02 * SOFT_SPEED, -0.1 * SOFT_SPEED]}
    return touching(*row, contact=[{"bodies": list("abcd"), "friction": 0.3}])


def closing_fast(method, law, gap, speed) -> Tables:
    """Two blocks whose contact must be foreseen."""
    data = closing(gap, speed) | {"method": method}
    for body in data["bodies"]:
        body["material"] = law
    return data


def on_one_rank() -> Tables:
    """Two squares of material points in contact, whose points have one stencil, and so one owner."""
    squares = [
        {"name": name, "shape": {"box": {"lower": [low, 0.0], "upper": [low + 1.0, 1.0]}}, "particles": [3, 3]}
        | {"placement": "cells", "material": COPPER, "velocity": [speed, "0"]}
        for name, low, speed in (("a", 0.0, "100"), ("b", 1.0, "-100"))
    ]
    return touching(*squares, method={"kind": "mpm", "cell": 2.0})


RUBS = ("contact_energy", "friction_dissipation")
MET = {"grows": ("contact_energy",)}
of_bonds = discs(12, 0.08, method=FREE_BONDS | {"stabilisation": {"coefficient": 0.125}})
for name, data, stops in (("discs", discs(), (10, 18)), ("far apart", far_apart(), (4,))):
    data["end_time"] = 2.0 / SOFT_SPEED
    add(name, "tlsph contact friction free", data, stops=stops, balance=1e-3, **MET)
# the Riemann dissipation of `tlsph` has a moment; stress and contact have none
of_sph, promised = discs(), {"balance": 1e-3, "angular": 1e-12, "grows": RUBS[1:]}
of_sph["method"]["dissipation"] = 0.0
add("discs without dissipation", "tlsph contact friction free turns", of_sph, stops=(20,), **promised)
add("discs of bonds", "peridynamics contact friction free", of_bonds, stops=(100,), balance=4e-4, grows=RUBS[1:])
add("on one rank", "mpm contact free", on_one_rank(), steps=3, stops=(1,))
for kind in ("mpm", "ulsph"):
    tags = f"{kind} contact friction deletion"
    add(f"hammered, {kind}", tags, hammered(kind), stops=(20, 30), balance=1e-3, grows=RUBS)
add("torn tie", "mpm tlsph tie deletion", torn_tie("mpm"), stops=(20, 30), balance=2e-3, grows=("tie_energy",))
for name, method, law, stops in (
    ("out of sight", LEAPFROG, CLOSING_RUBBER, (1, 2, 4)),
    ("bonds, fast", BONDS, LINEAR, (1, 3, 5)),
):
    data = closing_fast(method, law, 3e-3, 120.0)
    add(f"closing {name}", f"{method['kind']} contact", data, steps=20, stops=stops, **MET)
for kind, method in {"mpm": POINTS, "ulsph": {"kind": "ulsph"}}.items():
    data = blocks(method, 800.0, 2e-6)
    add(f"blocks at speed, {kind}", f"{kind} contact flow free", data, steps=12, stops=(7,), **MET)
add("rubbing copper", "mpm contact friction heat", rubbing_copper(), steps=16, stops=(9,), grows=("friction_heat",))
both = bars("sph", "points", end_time=1.5 / SPEED)
add("bars of two methods", "tlsph mpm contact free", both, stops=(20,), balance=2e-3, **MET)
add("flying bars", "mpm contact migrates", flying_bars(), steps=50, stops=(29,), **MET)
add("substeps", "tlsph mpm tie substeps free", substepped("auto"), steps=12, stops=(6,), balance=2e-3, grows=())
add("tied bonds and points", "peridynamics mpm tie free", tied("bonds", "points"), steps=30, stops=(15,), balance=0.02)
add("tied sph and flow", "tlsph ulsph tie free", tied("sph", "flow"), steps=20, stops=(10,), balance=0.02)
add("all methods apart", "tlsph peridynamics mpm ulsph", apart(), steps=20, stops=(7,), balance=1e-2)
for kind in TOOLED:
    data = hit(kind)
    if kind in ("ulsph", "mpm"):
        data["method"]["rebalance"] = 1.01
    add(f"hit, {kind}", f"{data['method']['kind']} tool contact friction", data, steps=60, stops=(40,), **MET)
for name, data in SCENES.items():
    tags = "updated" if "reference" in data["method"] else ""
    add(f"small {name}", f"fields {data['method']['kind']} {tags}", data, stops=(1, 12))
