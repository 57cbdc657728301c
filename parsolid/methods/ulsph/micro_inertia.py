class MicroInertiaSolid:
    pass
