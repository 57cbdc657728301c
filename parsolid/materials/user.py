"""Laws of users' files, each under a name of its own text, so that numba's cache can tell versions apart.

An index of the cache may name laws that this process has not loaded: it must be readable all the same.
"""


def __getattr__(name: str) -> type:
    if not name.startswith("Law_"):
        raise AttributeError(name)
    stand_in = type(name, (tuple,), {"__module__": __name__, "_fields": ()})
    globals()[name] = stand_in
    return stand_in
