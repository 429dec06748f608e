"""What the words of `Capability` mean to whoever connects a code: the same in README.md, the template and SCHEMA.md."""

from validation.methods.protocol import Capability

MEANINGS: dict[Capability, str] = {
    "analysis": "statics of small strain: u (p, 2) and stress (p, 3), xx, yy, xy, at the points, in their order",
    "gradient": "dC/dE (p,), C the compliance, by the points' moduli",
    "load steps": "`count` equal steps of large deformation: positions and Cauchy stress after each",
    "shape functions": "nodes, values and gradients at positions, on their own",
    "sheared domains": "the same of parallelograms by their corners, as CPDI has them; in Python only",
    "quadrature at points": "nothing to do; stress at points, by `case.points.volume`, makes the internal force",
    "points anywhere": "`case.points` as they are, of unequal sizes, too; without the word only a lattice that fills "
    "the body",
    "moduli by point": "`case.moduli` by point; without the word all are equal",
    "body forces": "`case.carried` alone is enough, it holds them; `case.body_force` only if the code shares them out "
    "itself",
    "loads at positions": "add sum_k N_i(x_k) f_k of `case.acts.position` and `case.acts.force` to the nodal forces",
    "tractions": "integrate `case.acts.along` and `case.acts.throughout`; no check on the card asks it",
    "prescribed displacements": "hold nodes at `case.held.value`; without the word all values are 0",
    "plane stress": '`case.body.material.plane` is "stress": its law; without the word it is always "strain"',
    "materials by region": "`case.body.parts`: a law by region; no check on the card asks it",
    "any outline": "nothing to do if the code takes points and grid alone; no check on the card asks it",
}
"""What to do with which part of a case, in a line each."""


def table(words: tuple[Capability, ...] = tuple(MEANINGS)) -> str:
    """In Markdown."""
    return "| word | what to do |\n|---|---|\n" + "".join(f'| "{word}" | {MEANINGS[word]} |\n' for word in words)
