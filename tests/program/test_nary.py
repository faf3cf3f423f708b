from imdim.program.nary import fold_nary
from imdim.program.tree import OPS, Combine, Primitive, Program

A, B, C, D = (Primitive("sphere", (float(r),)) for r in range(1, 5))


def spelled(program: Program) -> str:
    return fold_nary(
        program, lambda i, p: "abcd"[int(p.size[0]) - 1], {op: lambda parts, op=op: f"{op[0]}({''.join(parts)})" for op in OPS}
    )


def join(op, left, right):
    return Combine(op, left, right)


def test_chains_become_one_operation():
    assert spelled(join("union", join("union", A, B), join("union", C, D))) == "u(abcd)"
    assert spelled(join("intersection", A, join("intersection", B, C))) == "i(abc)"
    assert spelled(join("difference", join("difference", A, B), join("union", C, D))) == "d(abcd)"


def test_what_does_not_associate_stays_nested():
    assert spelled(join("difference", A, join("difference", B, C))) == "d(ad(bc))"
    assert spelled(join("difference", join("union", A, B), C)) == "d(u(ab)c)"
    assert spelled(join("union", join("difference", A, B), C)) == "u(d(ab)c)"


def test_depth_is_no_limit():
    program: Program = A
    for number in range(3000):
        program = join("union" if number % 2 else "difference", program, B)
    assert spelled(program).count("b") == 3000
