"""Domain decomposition for particles and points on many processors: MPI and geometry, no physics.

    plan          Plan: which rows go to which neighbours, in persistent messages; swap, send_to_some: once
    halo          Halo: ghost layers, owner -> ghost and ghost -> owner
    bisection     bisect, cut_cells, CutTree: weighted recursive coordinate bisection of points and of cells
    boxes         cuts of boxes of lattice nodes along their planes, and messages across these
    migration     migrate: hand rows of arrays to their new owners
    pair_search   ClosePairs, half_pairs: pairs of points closer than the sum of their radii
    grid          RankGrid: cells owned by ranks, nodes shared between them, particles handed over by cell
    occupied      OccupiedCells, Mirror: the cells that hold particles, and their nodes
    shared_nodes  SharedNodes: nodes on which two grids meet
    slices        Slices: numbered rows that ranks keep, deliver and ask for
    reduction     sums, MinimumAhead
    timer         COMMUNICATION: the clock of what a rank spends on messages

No rank ever holds all points. Every result has the same order, to the bit, for the same input on the same ranks.
"""
