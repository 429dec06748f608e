"""What the report is about, and its studies in their order: the table of contents of every page."""

from validation.harness.contents import Contents

CONTENTS = Contents(
    title="Does the material point method change optimised designs?",
    asked="Topology optimisation by the material point method (MPM, 2 x 2 points in a cell, h) beside finite elements "
    "(FEM, one a point), judged by one fine reference.",
    paper="Topology optimization with material point method: investigation into the design sensitivity and the effect "
    "of shape functions",
    details="authors, journal, year and DOI: not in our copy of it",
    cite="The mpmtop developers: mpmtop, with the commit at the foot of this page (CITATION.cff)",
    groups={
        "Verification": ("verification", "sensitivity", "shape_functions", "locking", "errata", "codes"),
        "The paper": (
            *("removal", "cantilever", "l_bracket", "crossing_cantilever", "crossing_l_bracket", "hole"),
            *("multi_resolution", "choices"),
        ),
        "Beyond the paper": (
            "tasks",
            "crossing",
            "loads_and_supports",
            "large_deformation",
            "large_designs",
            "work_precision",
        ),
        "Cost": ("scale", "skipping", "peers"),
        "Robustness": ("stability",),
    },
    topics=("Points as seeded", "Points have crossed cells", "What to do", "The paper"),
    advice="What to do",
    methods=("FEM", "MPM", "GIMP", "MPM, crossed", "GIMP, crossed", "B-spline, crossed"),
)
