"""Stub."""
def lattice_convolution(bonds, control):
    """None."""
    return None
