"""What a person may drop onto the page: parts, and everything else."""

import numpy as np
import pytest
import trimesh
from tests.app.lab.page.browser import in_the_lab

pytestmark = in_the_lab
JUNK = {
    "picture.stl": "not a whole STL file",
    "empty.stl": "empty (0 bytes)",
    "nan.xyz": "not finite",
    "huge.stl": "200 MB are too large, at most 64 MB can be uploaded",
}
WATCH = """() => { window.said = []; const look = () => {
    for (const e of document.querySelectorAll('.mantine-Notification-root')) {
      if (e.getClientRects().length) said.push(e.textContent); } };
  new MutationObserver(look).observe(document.body, {childList: true, subtree: true, characterData: true}); }"""
DROP = """() => {
  const carried = new DataTransfer();
  const lines = Array.from({ length: 500 }, (_, i) => `${Math.sin(i)} ${Math.cos(i)} ${i / 99}`);
  carried.items.add(new File([lines.join('\\n')], 'dropped.xyz'));
  document.querySelector('canvas').dispatchEvent(new DragEvent('drop', { dataTransfer: carried, bubbles: true, cancelable: true }));
}"""


@pytest.fixture
def junk(tmp_path):
    (tmp_path / "picture.stl").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 20)
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "nan.xyz").write_text("nan nan nan\n" * 100)
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(200 * 2**20)
    return tmp_path


def test_junk_is_refused_in_one_line_and_the_lab_goes_on(phone, junk):
    before = phone.status("part")
    phone.page.evaluate(WATCH)
    for name, text in JUNK.items():
        phone.page.set_input_files("input[type=file]", junk / name)
        assert phone.notice(text).startswith(f"{name}: ")
        assert phone.status("part") == before
    phone.page.wait_for_function("t => said.some((s) => s.includes(t))", arg=JUNK["huge.stl"])
    assert not phone.page.evaluate("said.some((s) => s.includes('success'))"), "nothing that was refused is said to be taken"
    (junk / "cube.stl").write_bytes(trimesh.creation.box((3, 2, 1)).export(file_type="stl"))
    phone.page.set_input_files("input[type=file]", junk / "cube.stl")
    phone.says("cube.stl")
    phone.run()
    assert phone.volume() == pytest.approx(6.0, rel=1e-3)


def test_a_file_is_dropped_onto_the_picture(phone):
    phone.page.evaluate(DROP)
    phone.says("dropped.xyz")


def test_a_larger_cloud_than_the_server_takes_is_thinned(phone, tmp_path):
    points = trimesh.sample.sample_surface(trimesh.creation.icosphere(), 40_000, seed=0)[0]
    np.save(tmp_path / "cloud.npy", points)
    phone.page.set_input_files("input[type=file]", tmp_path / "cloud.npy")
    assert int(phone.notice("40000 points thinned to ").split("thinned to ")[1].split(",")[0]) <= 20_000
