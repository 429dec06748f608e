"""Bodies with known answers, scenes of the paper, and the families of displacements that move material points."""
