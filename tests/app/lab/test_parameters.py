"""The parameter table's rows against the command's list of names, and what a person does in it against `imdim edit`."""

import pytest
from tests.app.lab.test_edges import TARGET
from tests.app.lab.test_edges import THEORY as BLENDED

from imdim.app.lab import edits, naming, protocol, renderers, work
from imdim.app.lab.document import Document
from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.parameters import hold_value, list_parameters, read_number, report_edit, set_value, untie_name
from imdim.app.lab.relation_words import say_relation
from imdim.app.lab.requests import request
from imdim.app.lab.solving import Lock
from imdim.app.lab.table import parameter_table
from imdim.delivery.finish import finish
from imdim.export.delivered import EditError, meanings, read_values
from imdim.export.edit import change_values, open_delivered
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.solid import volume
from imdim.program import codec
from imdim.program.constraints import Constraint, Ref, renumber_constraints
from imdim.program.tree import Combine, Primitive, combine_all, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.fitting import relations_of
from imdim.relations.residuals import rebase_constraints
from imdim.target.target import frame_meta

BRACKET = example("Bracket")


@pytest.fixture(scope="module")
def theory():
    """What the lab holds after a run."""
    program, constraints = relations_of(PROGRAMS["Bracket"]())
    found = finish(program, constraints)
    kept = rebase_constraints(found.program, renumber_constraints(constraints, {old: new for new, old in enumerate(found.order)}))
    named = naming.name_finished(found, frame_meta(BRACKET), kept, program)
    return ConstrainedProgram(found.program, kept, named=named)


def rows(theory):
    return {row.name: row for row in list_parameters(theory)}


def document(theory, target=BRACKET):
    out = Document(lambda *_: None)
    out.state.target = target
    out.history.push("fit", theory)
    return out


def test_rows_are_the_names_that_the_command_lists(theory):
    own = theory.names.delivered
    assert [*rows(theory)] == [*meanings(own)]
    assert {name: row.value for name, row in rows(theory).items()} == {**own.values, **own.counts}
    assert read_values(own.texts["program.scad"]) == own.values
    hole = rows(theory)["hole_diameter"]
    assert (hole.drives, hole.tied) == ("diameter of hole #2 to #5", True)
    assert hole.shown == (2, 3, 4, 5)
    assert {lock.leaf for lock in hole.locks} == {2, 3, 4, 5}
    assert rows(theory)["plate_thickness"].drives == "length along z of plate; moves boss, hole #2 to #5 and bore"


def test_setting_a_value_is_the_commands_edit(theory):
    after = set_value(theory, "plate_thickness", 12.0)
    same = change_values(theory.names.delivered, {"plate_thickness": 12.0})
    assert after.program == same.program
    assert after.names.delivered.texts == same.texts
    assert rows(after)["plate_thickness"].value == 12.0
    changed, line = report_edit(theory.names.delivered, after.names.delivered)
    assert not changed
    assert line.startswith("size 80 x 50 x 24 -> 80 x 50 x 28; volume ")
    assert line.endswith("in kind as before: 1 body, 5 through-holes")
    assert set_value(theory, "plate_thickness", 8.0) is theory, "nothing to take back"


def test_a_count_makes_another_program(theory):
    after = set_value(theory, "hole_count_x", 3.0)
    assert len(list(leaves(after.program))) == len(list(leaves(theory.program))) + 2
    assert rows(after)["hole_count_x"].value == 3.0


@pytest.mark.parametrize(("name", "value", "says"), [("boss_diameter", -3.0, "positive"), ("height_of_all", 1.0, "no parameter")])
def test_what_cannot_be_is_refused(theory, name, value, says):
    with pytest.raises(EditError, match=says):
        set_value(theory, name, value)


def test_what_parts_the_part_is_told_or_refused(theory):
    after = set_value(theory, "bore_diameter", 52.0)
    changed, line = report_edit(theory.names.delivered, after.names.delivered, 1)
    assert changed
    assert "1 body became 2" in line
    assert line.endswith("1 relation no longer holds")
    with pytest.raises(LabEditError, match="bore_diameter = 52: 1 body became 2"):
        set_value(theory, "bore_diameter", 52.0, strict=True)


def test_a_tie_is_broken_and_stays_so(theory):
    apart = untie_name(theory, "hole_diameter")
    assert {"hole2_diameter", "hole3_diameter", "hole4_diameter"} <= {*rows(apart)}
    assert not rows(apart)["hole_diameter"].tied
    wider = set_value(apart, "hole2_diameter", 10.0)
    assert sorted(p.size[0] for p in leaves(wider.program))[:4] == [3.0, 3.0, 3.0, 5.0]
    assert wider.names.is_final, "it is downloaded as it is, not tied again"


def test_files_are_the_program_as_it_is_shown(theory):
    apart = set_value(untie_name(theory, "hole_diameter"), "hole2_diameter", 10.0)
    (files,) = work.files(request("files", BRACKET, Settings(), apart, front=[], stop="edited"), lambda: 0.0)
    own = apart.names.delivered
    for name, text in own.texts.items():
        assert files.arrays[name].tobytes().decode() == text
    assert codec.from_json(codec.parse(files.arrays["program.json"].tobytes())) == own.program


def test_a_finished_program_says_which_primitive_was_which():
    holes = [Primitive("cylinder", (3.0, 20.0), (x, y, 0.0)) for x, y in ((30.0, 17.0), (-30.0, -17.0), (30.0, -17.0), (-30.0, 17.0))]
    drilled = Combine("difference", Primitive("box", (80.0, 50.0, 8.0)), combine_all("union", holes))
    program, constraints = relations_of(drilled)
    found = finish(program, constraints)
    before = list(leaves(program))
    assert sorted(found.order) == list(range(len(before)))
    assert found.order != tuple(sorted(found.order)), "it tells something here"
    for part, old in zip(leaves(found.program), found.order, strict=True):
        assert part.kind == before[old].kind
        assert part.center[:2] == pytest.approx(before[old].center[:2], abs=1e-3)


def test_a_lock_holds_what_a_name_is_the_value_of(theory):
    held = hold_value(theory, rows(theory)["boss_diameter"])
    assert held.locks == {Lock(1, "r")}
    assert rows(held)["boss_diameter"].locked
    assert not rows(held)["plate_length"].locked
    assert hold_value(held, rows(held)["boss_diameter"]).locks == frozenset()
    thicker = set_value(held, "plate_thickness", 9.0)
    assert thicker.locks == held.locks


def test_names_go_with_messages_and_agree_with_their_program(theory):
    message = protocol.unpack_message(protocol.pack_message(protocol.Message("m", naming.to_values(theory.names))))
    again = naming.from_values(message.values, theory.constraints)
    assert again.is_of(theory.program, theory.constraints, theory.edges)
    assert again.followers == theory.names.followers
    assert (again.labels, again.origin) == (theory.names.labels, theory.names.origin)
    opened = open_delivered(message.values["document"], message.values["texts"])
    assert opened.values == theory.names.delivered.values


def test_other_edits_lose_the_names_until_there_are_new_ones(theory):
    hand = document(theory)
    assert hand.edit("number 1 r", lambda t: edits.with_number(t, 1, "r", 15.0, True))
    assert hand.theory.names is None
    with pytest.raises(LabEditError, match="getting its names"):
        set_value(hand.theory, "boss_diameter", 31.0)
    hand.give_names()
    assert rows(hand.theory)["boss_diameter"].value == 30.0
    text = hand.theory.names.delivered.texts["program.scad"]
    assert volume(read_openscad(text)) == pytest.approx(volume(hand.theory.program), rel=1e-6)
    hand.undo()
    assert hand.theory.names is theory.names, "a step back has the names that it had"


def test_a_person_sets_holds_unties_and_takes_back(theory):
    hand = document(theory)
    hand.set_parameter("plate_thickness", "12,5")
    edit = hand.report()
    assert edit is not None
    assert (edit.what, edit.after) == ("plate_thickness = 12.5", hand.theory)
    assert hand.report() is None, "once"
    assert hand.state.notice[0] == "info"
    assert hand.state.notice[1].startswith("plate_thickness = 12.5: size 80 x 50 x 24 -> 80 x 50 x 28.5")
    hand.set_parameter("bore_diameter", "52")
    hand.report()
    assert hand.state.notice[0] == "warning"
    hand.undo()
    hand.set_parameter("boss_diameter", "much")
    assert (hand.state.notice, hand.state.refused) == (("error", "'much' is no number"), 1)
    hand.report()
    assert hand.state.notice[0] == "error", "nothing was done that could be told"
    names = [*rows(hand.theory)]
    hand.hold_parameter(names.index("boss_diameter"))
    assert rows(hand.theory)["boss_diameter"].locked
    hand.untie_parameter(names.index("plate_length"))
    assert "untied" not in hand.state.notice[1]
    hand.untie_parameter(names.index("hole_diameter"))
    assert "hole_diameter is untied" in hand.state.notice[1]
    for _ in range(3):
        hand.undo()
    assert hand.theory == theory
    assert not hand.history.can_undo


def test_sizes_of_fillets_are_rows_too():
    hand = document(BLENDED, TARGET)
    hand.give_names()
    row = rows(hand.theory)["fillet_radius"]
    assert (row.drives, row.shown, row.locks) == ("size of fillet 2 of 4 edges", (3,), frozenset())
    hand.set_parameter("fillet_radius", "3")
    assert hand.theory.edges[1].sizes == (3.0,)
    hand.edit("number edge 0 0", lambda t: edits.with_edge_size(t, 0, 0, 1.5))
    hand.give_names()
    assert rows(hand.theory)["chamfer_distance"].value == 1.5


@pytest.mark.parametrize(("text", "value"), [(" 12.5 ", 12.5), ("12,5", 12.5), ("-3", -3.0), ("1e2", 100.0)])
def test_numbers_are_read_as_people_type_them(text, value):
    assert read_number(text) == value


@pytest.mark.parametrize("text", ["", "wide", "1 2", "nan", "inf", "1,2,3"])
def test_what_is_no_number_is_said(text):
    with pytest.raises(LabEditError, match=r"no (finite )?number"):
        read_number(text)


def test_the_table_marks_what_is_selected_and_has_buttons_that_do_something(theory):
    html = parameter_table(list_parameters(theory), "mm", 1, 0)
    assert html.count("data-row=") == len(rows(theory))
    assert html.count(" data-marked") == 2  # the boss's diameter, and its height
    assert html.count(">untie<") == 1
    assert html.count("aria-pressed=") == sum(bool(row.locks) for row in rows(theory).values())
    assert 'value="28"' in html
    assert parameter_table(list_parameters(theory), "mm", 1, 1) != html, "what was refused is drawn over"


def test_the_code_is_the_file_and_its_lines_select(theory):
    text = theory.names.delivered.texts["program.scad"]
    html = renderers.code(theory, 1)
    assert "r = boss_diameter/2" in html
    assert html.count("data-n=") == 7
    assert text.replace("&", "&amp;") in html, "to be copied whole"
    lever = ConstrainedProgram(PROGRAMS["Lever"]())
    lever = document(lever, example("Lever"))
    lever.give_names()
    shown = renderers.code(lever.theory, None).partition("</textarea>")[2]
    assert "function ring" not in shown
    assert "the copy has them" in shown
    assert "function ring" in renderers.code(lever.theory, None)


PARTS = [Primitive("box", (4.0, 3.0, 1.0)), *[Primitive("cylinder", (0.5, 2.0))] * 3, Primitive("sphere", (1.0,))]
LABELS = ["plate", "hole", "hole", "boss", "ball"]


@pytest.mark.parametrize(
    ("constraint", "words"),
    [
        (Constraint("equal", (Ref(1, "r"), Ref(2, "r"))), "hole #1, #2 have equal diameter"),
        (Constraint("equal", (Ref(1, "r"), Ref(2, "r"), Ref(3, "r"))), "hole #1, #2 and boss have equal diameter"),
        (Constraint("equal", (Ref(3, "h"), Ref(0, "sz"))), "height of boss and length along z of plate are equal"),
        (Constraint("value", (Ref(3, "r"),), value=0.5), "diameter of boss is 1 mm"),
        (Constraint("parallel", (Ref(-1, "z"), Ref(1, "z"), Ref(3, "z"))), "hole #1 and boss are parallel to the z axis"),
        (Constraint("parallel", (Ref(-1, "x"), Ref(0, "x"))), "the x axis of plate is parallel to the x axis"),
        (Constraint("perpendicular", (Ref(0, "x"), Ref(3, "z"))), "the x axis of plate and boss are at a right angle"),
        (Constraint("coplanar", (Ref(0, "+z"), Ref(3, "+z"))), "the top face of plate and the top face of boss are flush"),
        (Constraint("coplanar", (Ref(0, "+z"), Ref(3, "+z")), value=2.0), "the top face of plate and the top face of boss are 2 mm apart"),
        (Constraint("aligned", (Ref(1), Ref(2)), Ref(-1, "y")), "hole #1 and hole #2 are level along the y axis"),
        (Constraint("aligned", (Ref(1), Ref(3)), Ref(-1, "y"), 4.0), "hole #1 and boss are 4 mm apart along the y axis"),
        (Constraint("coaxial", (Ref(3, "z"), Ref(1, "z"))), "boss and hole #1 share one axis"),
        (Constraint("concentric", (Ref(3), Ref(4))), "boss and ball share one centre"),
        (Constraint("tangent", (Ref(3, "r"), Ref(0, "+x"))), "boss is tangent to the right face of plate"),
        (Constraint("tangent", (Ref(4, "r"), Ref(3, "r"))), "ball is tangent to boss"),
        (Constraint("symmetric", (Ref(1), Ref(2), Ref(0)), Ref(-1, "x")), "plate is midway between hole #1 and hole #2 along the x axis"),
        (Constraint("linear", (Ref(1), Ref(2), Ref(3))), "hole #1, #2 and boss stand in a row with equal steps"),
        (Constraint("circular", (Ref(1), Ref(2)), Ref(3, "z")), "hole #1, #2 are spaced evenly around boss"),
    ],
)
def test_relations_are_said_in_words(constraint, words):
    assert say_relation(constraint, LABELS, PARTS, "mm") == words


def test_files_are_called_by_the_part():
    pytest.importorskip("viser")
    from imdim.app.lab.panels.take import file_name

    assert file_name("bracket.stl", "program.scad") == "bracket.scad"
    assert file_name("Bracket, scanned", "mesh.3mf") == "Bracket_scanned.3mf"
    assert file_name("v1.2 left.step", "program.py") == "v1.2_left.step.build123d.py"
    assert file_name("..", "report.html") == "part.html"


def test_lengths_are_read_as_the_setting_says():
    from tests.app.lab.test_session import Quiet

    from imdim.app.lab.session import Session

    session = Session(Quiet(), lambda *_: None)
    session.set_units("inch")
    session.open_example("Bracket")
    session.set_units("inch")
    assert session.state.target.units == "millimeter"
    assert session.state.target.mesh.extents[0] == pytest.approx(80 * 25.4)
    assert protocol.target_of(protocol.target_message(session.state.target)).units == "millimeter"
    session.set_units("auto")
    assert session.state.target.mesh.extents[0] == pytest.approx(80)
