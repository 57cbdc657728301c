"""The function of smoothing kernels that weights of pairs use."""

from parsolid.materials.law_functions import law_function


@law_function
def gradient_factor(kernel, q, dimension):
    """c f'(q)/q; zero at q = 0 and outside the support."""
