"""ViscoelasticHistory of one modulus from that of another: E(t) -> G(t) for an elastic bulk."""

import numpy as np


def shear_relaxation(bulk_modulus: float, equilibrium: float, moduli, times) -> tuple[float, np.ndarray, np.ndarray]:
    """Equilibrium value [Pa], moduli (m,) [Pa] and times (m,) [s] of G(t), exact for constant K, from those of E(t).

    With s times the Laplace transform, G(s) = 3 K E(s) / (9 K - E(s)): its poles -1/T_k are where E(s) = 9 K, one just
    beyond each pole of E. Terms of the same time become one, those without stiffness none. ValueError unless E(0+) < 9
    K.
    """
    # scipy takes as long to import as a small run
    from scipy.optimize import brentq

    K, times, moduli = bulk_modulus, np.asarray(times, float), np.asarray(moduli, float)
    if not equilibrium + moduli.sum() < 9.0 * K:
        raise ValueError("the instantaneous Young's modulus must be less than nine times the bulk modulus")
    present = moduli > 0.0
    poles = np.unique(1.0 / times[present])
    strengths = np.array([moduli[present & (1.0 / times == pole)].sum() for pole in poles])

    def distance(offset: float, j: int) -> np.ndarray:
        """Of -s = poles[j] (1 + offset) from every pole, written so that nothing cancels at that pole."""
        return (poles[j] - poles) + poles[j] * offset

    def excess(offset: float, j: int) -> float:
        """E(s) - 9 K."""
        return equilibrium + float(np.sum(strengths * poles[j] * (1.0 + offset) / distance(offset, j))) - 9.0 * K

    rates, slopes = [], []
    for j, pole in enumerate(poles):
        # two offsets between which E(s) - 9 K falls through zero: from plus infinity at a pole to minus infinity at the
        # next
        low = strengths[j] / (9.0 * K)
        last = j + 1 == len(poles)
        high = np.inf if last else (poles[j + 1] - pole) / pole * (1.0 - 1e-15)
        while low >= high or excess(low, j) < 0.0:
            low *= 0.5
        if last:
            # beyond the last pole E falls to E(0+) < 9 K
            high = 2.0 * low
            while excess(high, j) > 0.0:
                high *= 2.0
        offset = brentq(excess, low, high, args=(j,), xtol=1e-300, rtol=1e-14)
        rates.append(pole * (1.0 + offset))
        slopes.append(float(np.sum(strengths * poles / distance(offset, j) ** 2)))
    rate = np.array(rates)
    return 3.0 * K * equilibrium / (9.0 * K - equilibrium), 27.0 * K * K / (np.array(slopes) * rate), 1.0 / rate
