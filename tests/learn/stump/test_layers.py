"""The soft layers against the boolean ones, against automatic derivatives, and EdgeConv against its definition point by point."""

import itertools

import numpy as np
import pytest
import torch
from stump_forms import evaluate

from imdim.data.dice import quaternion_matrices
from imdim.geometry import kernels
from imdim.geometry.lowering import pack
from imdim.learn.stump.decoded import KINDS, LEAST, Decoded, distances, even_kinds, occupancy, start, to_primitives
from imdim.learn.stump.dgcnn import DGCNN, EdgeConv, nearest
from imdim.learn.stump.layers import SHARPNESS, complement_nodes, intersect_nodes, unite_terms
from imdim.program.stump import CsgStump
from imdim.program.tree import combine_all

CERTAIN = 30.0


def chance(seed):
    return torch.Generator().manual_seed(seed)


def random_matrices(k, c, seed):
    generator = chance(seed)
    return [(torch.rand(1, *shape, generator=generator) < share).float() for shape, share in (((k,), 0.4), ((c, k), 0.3), ((c,), 0.5))]


@pytest.mark.parametrize("seed", range(5))
def test_binary_layers_are_the_boolean_ones(seed):
    """All 2^5 combinations of five primitives, against `stump_forms.evaluate` on bit columns."""
    complement, connection, union = random_matrices(5, 4, seed)
    occupied = torch.tensor(list(itertools.product((0.0, 1.0), repeat=5)))[None]
    soft = unite_terms(intersect_nodes(complement_nodes(occupied, complement), connection), union)[0]
    numbers = start(8, 4, chance(0)).numbers
    primitives = to_primitives(Decoded(even_kinds(8), numbers, *[torch.zeros(1, 1)] * 3))[:5]
    bits = [tuple(int(v) for v in m.flatten()) for m in (complement, union)]
    stump = CsgStump(tuple(primitives), bits[0], tuple(tuple(int(v) for v in row) for row in connection[0].T), bits[1])
    exact = evaluate(stump, [column.numpy() > 0.5 for column in occupied[0].T])
    assert np.array_equal(soft.numpy() > 0.5, exact)
    assert float((soft - torch.as_tensor(exact).float()).abs().max()) < 1e-6


def test_steep_occupancy_is_that_of_the_primitives():
    shape = start(16, 8, chance(3))
    shape.numbers[..., 7:] *= 2
    certain = Decoded(shape.kinds, shape.numbers, *(CERTAIN * t.sign() for t in shape.tensors[1:]))
    points = torch.rand(1, 4000, 3, generator=chance(4)) - 0.5
    found, sdf = occupancy(certain, points, eta=1e5)
    bits = [tuple(int(v > 0) for v in m[0]) for m in (shape.complement, shape.union)]
    connection = tuple(tuple(int(v > 0) for v in row) for row in shape.connection[0].T)
    stump = CsgStump(tuple(to_primitives(shape)), bits[0], connection, bits[1])
    exact = evaluate(stump, list(sdf[0].T.numpy() < 0))
    clear = (sdf[0].abs() > 1e-3).all(1).numpy()
    assert clear.sum() > 3000
    assert 0.05 < exact.mean() < 0.95
    assert np.array_equal((found[0].numpy() > 0.5)[clear], exact[clear])


def test_soft_layers_and_their_gradients_are_those_of_the_plain_formula():
    """The mean under weights softmax(-40 z) that carry no gradient, as one table and by autograd."""
    generator = chance(1)
    nodes, w = torch.rand(2, 100, 6, generator=generator).double(), torch.rand(2, 5, 6, generator=generator).double()
    grad = torch.rand(2, 100, 5, generator=generator).double()
    results = []
    for run in (plain_intersection, intersect_nodes):
        inputs = [t.clone().requires_grad_() for t in (nodes, w)]
        out = run(*inputs)
        (out * grad).sum().backward()
        results.append([out.detach(), *(t.grad for t in inputs)])
    for mine, plain in zip(*results, strict=True):
        assert torch.allclose(mine, plain, atol=1e-10)


def plain_intersection(nodes, connection):
    z = connection[:, None] * nodes[:, :, None] + (1 - connection[:, None])
    return (torch.softmax(-SHARPNESS * z, -1).detach() * z).sum(-1)


def test_distances_are_those_of_the_kernels():
    """Quaternions, centres and sizes say what the program's primitives say: against the compiled leaf table."""
    shape = start(16, 4, chance(7))
    shape.numbers[..., :4] = torch.randn(1, 16, 4, generator=chance(8))
    points = torch.rand(1, 500, 3, generator=chance(9)) - 0.5
    table = kernels.leaf_table(*pack(combine_all("union", list(to_primitives(shape)))), points[0].double().numpy())
    assert np.allclose(distances(shape.kinds, shape.numbers, points)[0].T.numpy(), table, atol=2e-6)
    assert {KINDS[k] for k in shape.kinds} == {"box", "sphere", "cylinder", "cone"}
    assert min(size for p in to_primitives(shape) for size in p.size) >= LEAST


def test_quaternions_turn_as_their_axis_and_angle_say():
    angle = 0.7
    quaternion = 3.0 * torch.tensor([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]).float()
    expected = torch.tensor([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]).float()
    assert torch.allclose(quaternion_matrices(quaternion), expected, atol=1e-6)


def test_an_edge_convolution_is_the_maximum_over_edges():
    """One by one: A x_i + B (x_j - x_i) for the nearest j by brute force."""
    torch.manual_seed(0)
    layer, x = EdgeConv(3, 5, neighbours=4), torch.randn(2, 12, 3)
    found = layer.strongest(x)
    for b, i in itertools.product(range(2), range(12)):
        near = sorted(range(12), key=lambda j, b=b, i=i: float((x[b, j] - x[b, i]).norm()))[:4]
        edges = [layer.own(x[b, i]) + layer.offset(x[b, j] - x[b, i]) for j in near]
        assert torch.allclose(found[b, i], torch.stack(edges).amax(0), atol=1e-5)


def test_the_graph_is_that_of_the_features():
    """Layer two joins points that layer one made alike, wherever they are."""
    x = torch.tensor([[[0.0], [10.0], [0.1], [10.1]]])
    assert [sorted(row) for row in nearest(x, 2)[0].tolist()] == [[0, 2], [1, 3], [0, 2], [1, 3]]
    assert nearest(torch.randn(1, 9, 64), 9)[0].sort(-1).values.tolist() == [list(range(9))] * 9


def test_the_encoding_does_not_depend_on_the_order_of_points():
    torch.manual_seed(1)
    net, cloud = DGCNN(16, neighbours=5).eval(), torch.randn(1, 40, 3)
    shuffled = cloud[:, torch.randperm(40)]
    assert torch.allclose(net(cloud), net(shuffled), atol=1e-5)
