"""Material laws, one file each: a declared NamedTuple of parameters, and formulas chosen by its type."""
