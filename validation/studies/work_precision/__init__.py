"""Work and precision: the bodies analysed at many levels, what an analysis costs, and what is read from the runs.

Every body is scaled so that a cell of the grid, or an element, has the side h = 1, and `n` counts them along a side
that stays in proportion: displacements under given forces do not change, as E h^0 in the plane, and stresses are taken
times the side.
"""
