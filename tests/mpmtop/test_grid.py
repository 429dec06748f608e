"""Background grid: its lines as they are drawn."""

from mpmtop.grid import Grid


def test_segments_run_from_edge_to_edge() -> None:
    """On cells that are longer than wide, from an origin that is not zero: four lines across x, two across y."""
    ends = Grid((-1.0, 2.0), (0.5, 2.0), (3, 1)).segments
    across_x = [[[x, 2.0], [x, 4.0]] for x in (-1.0, -0.5, 0.0, 0.5)]
    assert ends.tolist() == [*across_x, [[-1.0, 2.0], [0.5, 2.0]], [[-1.0, 4.0], [0.5, 4.0]]]
