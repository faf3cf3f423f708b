"""Relations that the names of a program do not keep are left out."""

from dataclasses import replace
from fractions import Fraction

from tests.planted import box, cylinder, union

from imdim.export.kept_relations import keep_by_names
from imdim.export.numbers import Expression, Term
from imdim.export.parameters import parametrise
from imdim.program.constraints import Constraint, Ref

PROGRAM = union(box(40, 30, 4), box(10, 10, 8, (5, 0, 2)), cylinder(3, 12, (-10, 0, 4)))
FLUSH = Constraint("coplanar", (Ref(0, "-z"), Ref(1, "-z")))
EQUAL = Constraint("equal", (Ref(1, "sx"), Ref(1, "sy")))
PARALLEL = Constraint("parallel", (Ref(0, "z"), Ref(2, "z")))
ALL = (FLUSH, EQUAL, PARALLEL)


def test_what_the_names_say_stays():
    assert keep_by_names(PROGRAM, ALL, parametrise(PROGRAM, ALL, PROGRAM)) == ALL


def test_what_a_change_of_a_name_would_break_goes():
    """The block's bottom goes down with its height where its centre has no name, and with its width nothing else grows."""
    named = parametrise(PROGRAM, ALL, PROGRAM)
    still = replace(named, centers=(named.centers[0], *(tuple(Expression((), 1.0) for _ in range(3)) for _ in range(2))))
    assert keep_by_names(PROGRAM, ALL, still) == (EQUAL, PARALLEL)
    name = next(iter(named.values))
    wide = replace(named, sizes=(named.sizes[0], (Expression((Term(name, Fraction(1)),), 0.0), *named.sizes[1][1:]), named.sizes[2]))
    assert keep_by_names(PROGRAM, ALL, wide) == (FLUSH, PARALLEL)
