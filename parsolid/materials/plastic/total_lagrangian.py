"""One step of elastic-plastic solids on a tile of 32 particles, for methods that have deformation gradients F.

    b = F C_p^-1 F^T,   s = 2 mu dev(ln b)/2,   sigma = s - (P - mu d:d) 1,   P = A(J) + gamma E

d = dev(ln b)/2. State are C_p^-1 (METRIC, 1 at first), the equivalent plastic strain, E and T; all of a step follows
from F, so that it is exactly objective. The flow is isochoric along d and returns the Cauchy deviator to the flow
stress by the functions of `tile_update`: the elastic logarithmic strains of the new state are those of the trial state
with d shorter (Simo, Comput. Methods Appl. Mech. Eng. 99 (1992) 61; Weber & Anand, ibid. 79 (1990) 173). mu d:d makes
J mu d:d the energy of the deviator: without it a closed elastic cycle would take energy.

E is what the forces do that act, (P_0 + P):dF/2 with the stresses P of both ends of the step, and HEAT: in leapfrog it
is all the energy of a particle. Plastic work and heat are parts of it.

With kinematic hardening the flow is along the deviator less the back stress, which need not have the axes of d: then
ln(b)/2 of the new state is that of the trial state less the plastic strain of the step.

A method loads DEFORMATION (F at the end of the step), VELOCITY_GRADIENT (its change dF in the step), JACOBIAN (of its
start), METRIC*, STRESS* (first Piola-Kirchhoff), PLASTIC_STRAIN*, ENERGY*, TEMPERATURE*, HEAT, and for laws that fail
DAMAGE*, STRENGTH and CRITERIA*, with kinematic hardening REFERENTIAL_BACK_STRESS*; then `advance_tile`. Rows with * are
replaced; rows that are filled besides:

    NEW_JACOBIAN, DEVIATOR and PRESSURE (Cauchy) [Pa], INCREMENT, PLASTIC_WORK and RELEASED [J/m^3], ROOM,
    WAVES: symmetric tensor Q, rho0 c^2 <= N.QN of pressure waves along N [Pa]; SHEAR_MODULUS: its part of shear waves
    is mu/J H^T H, 0 of failed matter

Failed matter has no deviator, and pressure only where it is compressed; what it had stored is heat from then on.
"""

from parsolid.elementary import exp, log
from parsolid.kernels import inlined, kernel
from parsolid.materials.hyperelastic.functions import elastic_moduli, isotropic_shear_modulus
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.functions import (
    SLOWEST_RATE,
    cold_pressure,
    elastic_jacobian,
    grueneisen_coefficient,
    isentropic_bulk_modulus,
    melting_temperature,
    room_to_compress,
    shear_modulus,
    specific_heat,
    stress_measure,
    temperature_rise,
)
from parsolid.materials.plastic.tile_update import (
    BACK_STRESS,
    BACK_STRESS_ENERGY,
    BACK_WORK,
    CAPACITY,
    CRITERIA,
    DAMAGE,
    DEFORMATION,
    DEVIATOR,
    ENERGY,
    FAR,
    HEAT,
    INCREMENT,
    JACOBIAN,
    LOGARITHMS,
    MELTING,
    METRIC,
    NEW_JACOBIAN,
    PLASTIC_FLOW,
    PLASTIC_STRAIN,
    PLASTIC_VOLUME,
    PLASTIC_WORK,
    PRESSURE,
    REFERENTIAL_BACK_STRESS,
    RELEASED,
    ROOM,
    ROTATION,
    SHEAR_MODULUS,
    STRAIN,
    STRESS,
    TEMPERATURE,
    TRIAL,
    VELOCITY_GRADIENT,
    VOLUME_WORK,
    WAVES,
    WORST,
    advance_damage,
    find_relative_trial,
    flow_stress_before,
    move_back_stress,
    plastic_increments,
    release_back_stress,
)
from parsolid.principal import SMALL, exp_of_small, from_principal, log_of_small, principal
from parsolid.tensors import (
    add_spherical,
    cofactor,
    combine,
    congruence,
    contract,
    contract_symmetric,
    general,
    gram,
    inverse_symmetric,
    matmul,
    matmul_transposed,
    symmetric_part,
    times_symmetric,
    trace_symmetric,
    transpose,
)
from parsolid.tiles import TILE, load, load_symmetric, load_vector, store, store_symmetric, store_vector


@isotropic_shear_modulus.of(ElasticPlastic)
def _no_constant_shear(law):
    return None


@elastic_moduli.of(ElasticPlastic)
def _moduli_at_rest(law):
    """mu and lambda [Pa] of the undeformed solid at its reference temperature."""
    mu = shear_modulus(law.shear_modulus, 1.0, 0.0, law.reference_temperature, melting_temperature(law.melting, 1.0))
    return mu, isentropic_bulk_modulus(law.equation_of_state, 1.0, 0.0) - 2.0 / 3.0 * mu


@inlined
def advance_tile(law, failure, step, tile):
    """The state of a tile after a step [s]; a step of 0 finds the stress of the state."""
    hardening = law.kinematic_hardening
    find_trial(law, failure, tile)
    find_back_stress(hardening, tile)
    find_increments(law, hardening, step, tile)
    find_flow(law, hardening, step, tile)
    if failure is not None:
        fail(law, failure, step, tile)
        release_back_stress(law, hardening, tile)
    find_stress(law, failure, tile)


@kernel
def find_trial(law, failure, tile):
    """The elastic trial state: DEVIATOR, TRIAL, and what flow depends on, of the volume of the end and the energy of
    the start of the step. STRAIN: that of the step, by which flow is guessed."""
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    find_elastic_strain(tile)
    for p in range(TILE):
        F, change = load(tile, DEFORMATION * TILE + p), load(tile, VELOCITY_GRADIENT * TILE + p)
        H = cofactor(F)
        J = F[0] * H[0] + F[1] * H[1] + F[2] * H[2]
        temperature = tile[TEMPERATURE * TILE + p]
        measure, _ = stress_measure(law.flow_stress, J)
        elastic = elastic_jacobian(law.flow_stress, J, tile[PLASTIC_VOLUME * TILE + p])
        pressure = measure * cold_pressure(eos, elastic) + gamma * tile[ENERGY * TILE + p]
        melting = melting_temperature(law.melting, J)
        mu = measure * shear_modulus(law.shear_modulus, J, pressure, temperature, melting)
        d = load_symmetric(tile, DEVIATOR * TILE + p)
        if failure is not None:
            # failed matter bears no deviator
            whole = 1.0 if tile[DAMAGE * TILE + p] < 1.0 else 0.0
            d = times_symmetric(whole, d)
            for c in range(3):
                tile[(LOGARITHMS + c) * TILE + p] *= whole
        D = times_symmetric(1.0 / J, symmetric_part(matmul_transposed(change, H)))
        store_symmetric(tile, STRAIN * TILE + p, add_spherical(D, -(D[0] + D[1] + D[2]) / 3.0))
        store_symmetric(tile, DEVIATOR * TILE + p, times_symmetric(2.0 * mu, d))
        tile[TRIAL * TILE + p] = 2.0 * mu * (1.5 * contract_symmetric(d, d)) ** 0.5
        tile[NEW_JACOBIAN * TILE + p], tile[MELTING * TILE + p], tile[SHEAR_MODULUS * TILE + p] = J, melting, mu
        tile[CAPACITY * TILE + p] = law.density * specific_heat(law, temperature)
        tile[INCREMENT * TILE + p], tile[VOLUME_WORK * TILE + p] = 0.0, 0.0


@kernel
def find_elastic_strain(tile):
    """d of the trial state into the rows DEVIATOR. Where it is not small, FAR is 1 and LOGARITHMS (d by axes) and their
    axes in ROTATION are filled."""
    far = 0
    for p in range(TILE):
        b = congruence(load(tile, DEFORMATION * TILE + p), load_symmetric(tile, METRIC * TILE + p))
        S = add_spherical(times_symmetric(3.0 / (b[0] + b[1] + b[2]), b), -1.0)
        store_symmetric(tile, DEVIATOR * TILE + p, S)
        far += 0 if contract_symmetric(S, S) <= SMALL else 1
    tile[FAR * TILE] = 1.0 if far > 0 else 0.0
    if far > 0:
        for p in range(TILE):
            values, axes = principal(add_spherical(load_symmetric(tile, DEVIATOR * TILE + p), 1.0))
            l1, l2, l3 = 0.5 * log(values[0]), 0.5 * log(values[1]), 0.5 * log(values[2])
            mean = (l1 + l2 + l3) / 3.0
            d = (l1 - mean, l2 - mean, l3 - mean)
            store_symmetric(tile, DEVIATOR * TILE + p, from_principal(d, axes))
            store(tile, ROTATION * TILE + p, axes)
            store_vector(tile, LOGARITHMS * TILE + p, d)
    else:
        for p in range(TILE):
            half = times_symmetric(0.5, log_of_small(load_symmetric(tile, DEVIATOR * TILE + p)))
            store_symmetric(tile, DEVIATOR * TILE + p, add_spherical(half, -trace_symmetric(half) / 3.0))


@kernel
def find_elastic_stretch(power, row, tile):
    """exp(power d), |power| at most 2, into 6 rows."""
    if tile[FAR * TILE] > 0.0:
        for p in range(TILE):
            d, axes = load_vector(tile, LOGARITHMS * TILE + p), load(tile, ROTATION * TILE + p)
            stretch = from_principal((exp(power * d[0]), exp(power * d[1]), exp(power * d[2])), axes)
            store_symmetric(tile, row * TILE + p, stretch)
    else:
        for p in range(TILE):
            s, mu = load_symmetric(tile, DEVIATOR * TILE + p), tile[SHEAR_MODULUS * TILE + p]
            store_symmetric(tile, row * TILE + p, exp_of_small(times_symmetric(0.5 * power / mu, s)))


@kernel
def find_back_stress(hardening, tile):
    """BACK_STRESS in the present axes, V^-1 F B F^T V^-1 with the elastic stretch V of the trial state; None: nothing.

    B = F_p^-1 beta F_p^-T (REFERENTIAL_BACK_STRESS) of the back stress beta in the intermediate axes, in which plastic
    flow has no spin (Eterovic & Bathe, Int. J. Numer. Methods Eng. 30 (1990) 1099)."""
    if hardening is not None:
        find_elastic_stretch(-1.0, WAVES, tile)
        for p in range(TILE):
            F, unstretched = load(tile, DEFORMATION * TILE + p), load_symmetric(tile, WAVES * TILE + p)
            back = congruence(F, load_symmetric(tile, REFERENTIAL_BACK_STRESS * TILE + p))
            back = congruence(general(unstretched), back)
            back = times_symmetric(exp(-2.0 / 3.0 * log(tile[NEW_JACOBIAN * TILE + p])), back)
            # Cayley's quotient leaves a trace of third order in the step
            back = add_spherical(back, -trace_symmetric(back) / 3.0)
            store_symmetric(tile, BACK_STRESS * TILE + p, back)
        find_relative_trial(0.0, tile)


@kernel
def find_increments(law, hardening, step, tile):
    """INCREMENT of a step [s], and the back stress after it."""
    if step > 0.0:
        # without time to flow in, a stress above that of slow flow stays
        plastic_increments(law.flow_stress, law, hardening, step, tile)
    if hardening is not None:
        move_back_stress(hardening, 0.0, tile)


@kernel
def turn_elastic_axes(tile):
    """LOGARITHMS, ROTATION, DEVIATOR and REFERENTIAL_BACK_STRESS after PLASTIC_FLOW about a back stress, which need not
    have the axes of the trial state.

    F_p^-1 becomes F_p^-1 exp(-dp), dp in intermediate axes: B = G beta G^T with G = F^-1 V exp(-dp), dp in present axes
    and exp by Cayley's quotient, whose error is of third order in the step."""
    find_elastic_stretch(1.0, WAVES, tile)
    for p in range(TILE):
        H, J = cofactor(load(tile, DEFORMATION * TILE + p)), tile[NEW_JACOBIAN * TILE + p]
        stretch, flowed = load_symmetric(tile, WAVES * TILE + p), load_symmetric(tile, PLASTIC_FLOW * TILE + p)
        after = inverse_symmetric(add_spherical(times_symmetric(0.5, flowed), 1.0))
        after = matmul(general(after), general(add_spherical(times_symmetric(-0.5, flowed), 1.0)))
        back = congruence(after, load_symmetric(tile, BACK_STRESS * TILE + p))
        back = congruence(matmul(transpose(H), general(stretch)), back)
        back = times_symmetric(exp(-4.0 / 3.0 * log(J)), back)
        flows = tile[INCREMENT * TILE + p] > 0.0
        for c in range(6):
            at = (REFERENTIAL_BACK_STRESS + c) * TILE + p
            tile[at] = back[c] if flows else tile[at]
            tile[(DEVIATOR + c) * TILE + p] -= 2.0 * tile[SHEAR_MODULUS * TILE + p] * flowed[c]
    if tile[FAR * TILE] > 0.0:
        for p in range(TILE):
            s, mu = load_symmetric(tile, DEVIATOR * TILE + p), tile[SHEAR_MODULUS * TILE + p]
            values, axes = principal(times_symmetric(0.5 / mu, s))
            store_vector(tile, LOGARITHMS * TILE + p, values)
            store(tile, ROTATION * TILE + p, axes)


@kernel
def find_flow(law, hardening, step, tile):
    """Shorten LOGARITHMS and DEVIATOR by the INCREMENT of plastic strain: PLASTIC_STRAIN, PLASTIC_WORK (of the mean of
    the flow stress at the start of the step and the stress at its end), PRESSURE without failure, and the TEMPERATURE
    that belongs to it."""
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for p in range(TILE):
        x, mu, trial = tile[INCREMENT * TILE + p], tile[SHEAR_MODULUS * TILE + p], tile[TRIAL * TILE + p]
        temperature, J = tile[TEMPERATURE * TILE + p], tile[NEW_JACOBIAN * TILE + p]
        returned = trial - 3.0 * mu * x
        factor = returned / trial if x > 0.0 else 1.0
        rate = max(x / max(step, 1e-300), SLOWEST_RATE)
        before = flow_stress_before(law.flow_stress, tile[PLASTIC_STRAIN * TILE + p], rate, temperature, mu,
                                    tile[MELTING * TILE + p], returned)  # fmt: skip
        work = (0.5 * J * x * (before + returned) if x > 0.0 else 0.0) + tile[VOLUME_WORK * TILE + p]
        dissipated = work
        if hardening is not None:
            work += tile[BACK_WORK * TILE + p]
            dissipated = work - tile[BACK_STRESS_ENERGY * TILE + p]
        else:
            for c in range(3):
                tile[(LOGARITHMS + c) * TILE + p] *= factor
            for c in range(6):
                tile[(DEVIATOR + c) * TILE + p] *= factor
        tile[PLASTIC_STRAIN * TILE + p] += x
        part, heat = 0.5 * gamma * (J - tile[JACOBIAN * TILE + p]), tile[HEAT * TILE + p]
        rise = temperature_rise(law, temperature, law.taylor_quinney * dissipated + heat)
        tile[TEMPERATURE * TILE + p] = (temperature * (1.0 - part) + rise) / (1.0 + part)
        tile[PLASTIC_WORK * TILE + p], tile[RELEASED * TILE + p] = work, 0.0
        # what criteria of failure see, of the work of the old stress
        worked = contract(load(tile, STRESS * TILE + p), load(tile, VELOCITY_GRADIENT * TILE + p))
        elastic = elastic_jacobian(law.flow_stress, J, tile[PLASTIC_VOLUME * TILE + p])
        cold = stress_measure(law.flow_stress, J)[0] * cold_pressure(eos, elastic)
        tile[PRESSURE * TILE + p] = cold + gamma * (tile[ENERGY * TILE + p] + worked + heat)
    if hardening is not None:
        turn_elastic_axes(tile)


@kernel
def fail(law, failure, step, tile):
    """DAMAGE after a step [s]; where it reaches 1 the deviator goes, and what it stored is RELEASED as heat."""
    for p in range(TILE):
        tile[WORST * TILE + p] = tile[DAMAGE * TILE + p]
    advance_damage(failure.criteria, CRITERIA, step, tile)
    for p in range(TILE):
        old = tile[DAMAGE * TILE + p]
        damage = min(tile[WORST * TILE + p], 1.0) if old < 1.0 else old
        s, mu = load_symmetric(tile, DEVIATOR * TILE + p), tile[SHEAR_MODULUS * TILE + p]
        stored = tile[NEW_JACOBIAN * TILE + p] * contract_symmetric(s, s) / (4.0 * mu)
        released = stored if damage >= 1.0 and old < 1.0 else 0.0
        left = 0.0 if damage >= 1.0 else 1.0
        for c in range(3):
            tile[(LOGARITHMS + c) * TILE + p] *= left
        store_symmetric(tile, DEVIATOR * TILE + p, times_symmetric(left, s))
        tile[DAMAGE * TILE + p], tile[RELEASED * TILE + p] = damage, released
        tile[TEMPERATURE * TILE + p] += temperature_rise(law, tile[TEMPERATURE * TILE + p], released)


@kernel
def find_stress(law, failure, tile):
    """METRIC, ENERGY, PRESSURE, STRESS, WAVES and ROOM of the end of the step."""
    find_elastic_stretch(2.0, STRAIN, tile)
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for p in range(TILE):
        F, change = load(tile, DEFORMATION * TILE + p), load(tile, VELOCITY_GRADIENT * TILE + p)
        H, J = cofactor(F), tile[NEW_JACOBIAN * TILE + p]
        mu, s = tile[SHEAR_MODULUS * TILE + p], load_symmetric(tile, DEVIATOR * TILE + p)
        square = contract_symmetric(s, s) / (4.0 * mu * mu)
        # C_p^-1 = F^-1 b F^-T with the elastic b of the new state, of determinant J^2
        size = exp(-2.0 / 3.0 * log(J))
        stretch = load_symmetric(tile, STRAIN * TILE + p)
        metric = times_symmetric(size * size, congruence(transpose(H), stretch))
        flows = tile[INCREMENT * TILE + p] > 0.0
        if failure is not None:
            flows = flows or tile[DAMAGE * TILE + p] >= 1.0
        for c in range(6):
            at = (METRIC + c) * TILE + p
            tile[at] = metric[c] if flows else tile[at]
        # of the deviator, in which the pressure of the equation of state is not
        measure, of_cauchy = stress_measure(law.flow_stress, J)
        P = matmul(general(add_spherical(s, of_cauchy * mu * square)), H)
        a = contract(H, change)
        worked = 0.5 * contract(load(tile, STRESS * TILE + p), change) + tile[HEAT * TILE + p]
        worked += tile[ENERGY * TILE + p]
        cold = measure * cold_pressure(eos, elastic_jacobian(law.flow_stress, J, tile[PLASTIC_VOLUME * TILE + p]))
        energy = (worked + 0.5 * contract(P, change) - 0.5 * cold * a) / (1.0 + 0.5 * gamma * a)
        pressure = cold + gamma * energy
        if failure is not None:
            # a void is open at no pressure, and the forces that act do no other work
            opened = tile[DAMAGE * TILE + p] >= 1.0 and pressure <= 0.0
            energy, pressure = worked if opened else energy, 0.0 if opened else pressure
        q = 2.0 * mu * (1.5 * square) ** 0.5
        # Kirchhoff's pressure over J falls as the volume grows, too
        bulk = measure * isentropic_bulk_modulus(eos, J, pressure) + (1.0 - of_cauchy) * pressure
        bulk = max(bulk, 0.0)
        waves = times_symmetric((bulk + 4.0 / 3.0 * mu + 2.0 / 3.0 * q) / J, gram(H))
        room = room_to_compress(eos, J)
        store(tile, STRESS * TILE + p, combine(1.0, P, -pressure, H))
        store_symmetric(tile, WAVES * TILE + p, waves)
        tile[ENERGY * TILE + p], tile[PRESSURE * TILE + p] = energy, pressure
        # not a number where the state is none
        tile[ROOM * TILE + p] = room if room < waves[0] else waves[0]
