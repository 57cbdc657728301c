"""Error bars of any run: coarser companions of a scene, what their differences say, and runs that stop at a target."""
