import base64
import hashlib
import json
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import trimesh
from tests.export.coincident import MEANT
from tests.planted import box, cut, cylinder

from imdim.delivery.deliver import RunRecord, deliver
from imdim.export.html import content, page
from imdim.export.html_surfaces import MOST_FACES, cluster_vertices
from imdim.geometry.solid import surface_with_owners, to_manifold, to_trimesh
from imdim.geometry.triangles import distances, triangle_tree
from imdim.program.codec import to_json
from imdim.program.tree import Combine, Primitive, leaves
from imdim.target.target import Target, target_from

PROGRAM, EXACT, _ = MEANT["bracket"]
RUN = RunRecord("parts/bracket.stl", {"load": 0.5}, "finished", 7, {"budget_s": 60.0})
HOSTILE = (
    "<script>document.title = 'owned'</script>.stl",
    "</script><script>document.title = 'owned'</script>.stl",
    '"><img src=x onerror="document.title=\'owned\'">.stl',
    "</title><!--<script>.stl",
    "{{script}} {{data}} & &amp; ' \u2028.stl",
    "not utf-8 \udcff.stl",
)


class Outline(HTMLParser):
    """The tags of a page in order, their attributes, and the text at the beginning of each."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        self.texts.append((tag, ""))

    def handle_endtag(self, tag):
        self.texts.append(("", ""))

    def handle_data(self, data):
        if self.texts:
            tag, text = self.texts[-1]
            self.texts[-1] = (tag, text + data)

    def text(self, tag: str) -> list[str]:
        return [text for own, text in self.texts if own == tag]


def data_of(text: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1])


def points_of(packed: str, data: dict) -> np.ndarray:
    steps = np.frombuffer(base64.b64decode(packed), "<u2").reshape(-1, 3)
    low, high = np.array(data["low"]), np.array(data["high"])
    return low + steps / 65535 * (high - low)


def mesh_of(packed: dict, data: dict) -> trimesh.Trimesh:
    points = points_of(packed["points"], data)
    faces = np.frombuffer(base64.b64decode(packed["faces"]), "<u2" if len(points) <= 65535 else "<u4").reshape(-1, 3)
    return trimesh.Trimesh(points, faces.astype(np.int64), process=False)


@pytest.fixture(scope="module")
def delivered(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "bracket"
    report = deliver(PROGRAM, target_from(to_trimesh(to_manifold(PROGRAM, 200)), "bracket.stl"), folder, RUN)
    return folder, report, (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_says_what_the_files_say(delivered):
    folder, report, text = delivered
    data = data_of(text)
    assert data["report"] == report == json.loads((folder / "report.json").read_text())
    assert report["files"]["report.html"] == "written"
    assert report["timing"]["delivery_s"]["page"] > 0
    assert {n["name"]: n["value"] for n in data["names"]} == report["parameters"]
    assert [c["name"] for c in data["constraints"]] == [c["name"] for c in report["constraints"]]
    assert [leaf["kind"] for leaf in data["leaves"]].count("cylinder") == report["result"]["kinds"]["cylinder"]
    assert [c["error"] for c in data["front"]["choices"]] == [
        c["error"] for c in json.loads((folder / "front.json").read_text())["choices"]
    ]
    assert Outline(text).text("h1") == [""]
    assert Outline(text).text("bdi") == ["bracket.stl"]


def test_the_solid_has_its_volume_and_each_face_lies_on_its_primitive(delivered):
    data = data_of(delivered[2])
    mesh = mesh_of(data["solid"], data)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(EXACT, rel=1e-3)
    owners = np.repeat(*np.array(data["solid"]["owners"]).T)
    assert len(owners) == len(mesh.faces)
    assert set(owners) == set(range(len(data["leaves"])))
    for i, leaf in enumerate(data["leaves"]):
        primitive = Primitive(
            leaf["kind"], tuple(n["value"] for n in leaf["sizes"]), tuple(n["value"] for n in leaf["center"]), tuple(leaf["rotation"])
        )
        corners = mesh.vertices[mesh.faces[owners == i]].reshape(-1, 3)
        assert distances(triangle_tree(to_trimesh(to_manifold(primitive))), corners).max() < 0.02, leaf["kind"]


def test_the_roles_are_those_of_the_operations(delivered):
    roles = [(leaf["kind"], leaf["role"]) for leaf in data_of(delivered[2])["leaves"]]
    assert roles[:2] == [("box", "adds"), ("cylinder", "adds")]
    assert {role for _, role in roles[2:]} == {"cuts"}
    nested = cut(box(4, 4, 4), Combine("intersection", box(2, 2, 2), cut(box(3, 3, 3), cylinder(1, 9))))
    assert [leaf["role"] for leaf in content(to_json(nested))["leaves"]] == ["adds", "cuts", "cuts", "adds"]
    both = Combine("intersection", box(2, 2, 2), cylinder(1, 9))
    assert [leaf["role"] for leaf in content(to_json(both))["leaves"]] == ["bounds", "bounds"]


def test_the_distances_are_those_of_the_target():
    """A box of 4 x 2 x 1 with a tower that the program lacks: a point of the tower is as far off as it is high."""
    plate, tower = box(4, 2, 1), Primitive("box", (0.4, 0.4, 1.0), (1.0, 0.0, 0.9))
    target = target_from(to_trimesh(to_manifold(Combine("union", plate, tower))), "tower")
    data = content(to_json(plate), target)
    mesh = mesh_of(data["target"], data)
    far = np.frombuffer(base64.b64decode(data["target"]["distances"]), np.uint8) / 255 * data["target"]["top"]
    assert data["target"]["top"] == pytest.approx(0.9, rel=1e-3)
    np.testing.assert_allclose(far, np.maximum(mesh.vertices[:, 2] - 0.5, 0.0), atol=0.9 / 255)
    assert mesh.volume == pytest.approx(target.mesh.volume, rel=1e-3)
    assert mesh.edges_unique_length.max() < 1.01 * math.dist(data["low"], data["high"]) / 40


def test_a_cloud_and_a_program_alone():
    points = np.random.default_rng(0).normal(size=(90_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    text = page(content(to_json(Primitive("sphere", (0.9,))), target_from(points)))
    data = data_of(text)
    assert len(points_of(data["target"]["points"], data)) == 40_000
    assert "faces" not in data["target"]
    assert data["target"]["top"] == pytest.approx(0.1, abs=2e-3)
    alone = data_of(page(content(to_json(Primitive("sphere", (0.9,))), name="ball")))
    assert (alone["name"], alone["target"], alone["report"], alone["front"]) == ("ball", None, None, None)


def test_the_size_is_bounded():
    ball = trimesh.creation.icosphere(subdivisions=6)  # 81,920 faces
    program = Combine("union", Primitive("sphere", (1.0,)), Primitive("torus", (1.2, 0.2)))
    text = page(content(to_json(program), target_from(ball), segments=256))
    assert len(text) < 3_000_000
    data = data_of(text)
    for packed in (data["solid"], data["target"]):
        assert 1000 < len(mesh_of(packed, data).faces) <= MOST_FACES
    assert mesh_of(data["target"], data).volume == pytest.approx(ball.volume, rel=0.01)


def test_the_same_content_gives_the_same_bytes():
    document, target = to_json(PROGRAM), target_from(to_trimesh(to_manifold(PROGRAM)))
    assert page(content(document, target)) == page(content(document, target))


def test_thinning_keeps_the_shape_and_the_owners():
    surface, owners = surface_with_owners(Combine("union", Primitive("sphere", (1.0,)), Primitive("sphere", (0.8,), (1.0, 0.0, 0.0))), 200)
    vertices, faces, kept = cluster_vertices(np.asarray(surface.vertices), np.asarray(surface.faces), 4000)
    assert 800 < len(faces) <= 4000
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(surface.volume, rel=0.05)
    middle = vertices[faces].mean(axis=1)
    right = np.linalg.norm(middle - [1.0, 0.0, 0.0], axis=1) - 0.8
    left = np.linalg.norm(middle, axis=1) - 1.0
    assert ((np.abs(right) < np.abs(left)) == (owners[kept] == 1)).mean() > 0.95


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_text(name):
    """Whatever a part is called, the page has the tags of its template, two scripts among them, and shows the name as it is."""
    target = target_from(to_trimesh(to_manifold(box(1, 1, 1))))
    named = Target(name, target.points, target.normals, target.mesh, True, (name,))
    document, report = to_json(box(1, 1, 1)), {"input": name, "target": {"name": name, "notes": [name]}}
    text = page(content(document, named), report)
    harmless = Outline(page(content(document, target), {**report, "input": "", "target": {}}))
    outline = Outline(text)
    assert outline.tags == harmless.tags
    assert outline.tags.count("script") == 2
    assert [name for name, _ in outline.attributes] == [name for name, _ in harmless.attributes]
    printable = name.encode("utf-8", "replace").decode()
    assert outline.text("bdi") == [printable]
    assert outline.text("title") == [f"{printable} - IMDIM report"]
    assert data_of(text)["report"]["target"]["notes"] == [name]
    text.encode("utf-8")


def test_the_policy_lets_in_the_own_script_and_style_alone(delivered):
    outline = Outline(delivered[2])
    policy = next(value for name, value in outline.attributes if name == "content" and "default-src" in value)
    assert policy.startswith("default-src 'none'; ")
    for tag, inline in (("script", outline.text("script")[1]), ("style", outline.text("style")[0])):
        digest = base64.b64encode(hashlib.sha256(inline.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}';" in policy
    assert "unsafe" not in policy


def test_nothing_is_fetched(delivered):
    outline = Outline(delivered[2])
    assert not {name for name, _ in outline.attributes} & {"src", "href", "action", "background", "poster", "style", "srcset"}
    addresses = set(re.findall(r"\w+://[^\s\"'`)]+", delivered[2]))
    assert addresses == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"fetch\(|XMLHttpRequest|import\(|innerHTML|insertAdjacentHTML|document\.write|eval\(|url\(", delivered[2])


def test_leaves_of_the_tree_are_those_of_the_program():
    """Four holes in a row are one node that stands for four leaves."""
    holes = [cylinder(3, 6, (x, 0.0, 0.0)) for x in (-30.0, -10.0, 10.0, 30.0)]
    target = target_from(to_trimesh(to_manifold(cut(box(80, 30, 6), *holes))))
    from imdim.delivery.finish import finish
    from imdim.relations.discover import exact_relations

    found = finish(exact_relations(cut(box(80, 30, 6), *holes)).program)
    data = content(to_json(found.program, None, found.constraints, found.folded), target, found.parameters)
    assert data["tree"]["leaves"] == len(list(leaves(found.program))) == len(data["leaves"]) == 5
    row = data["tree"]["parts"][1]
    assert (row["is"], row["counts"], row["first"], row["leaves"]) == ("linear", [4], 1, 4)
    assert row["parts"] == [{"is": "primitive", "first": 1, "leaves": 1, "parts": []}]
    count = next(n for n in data["names"] if n["value"] == 4)
    assert count["leaves"] == [1, 2, 3, 4]
