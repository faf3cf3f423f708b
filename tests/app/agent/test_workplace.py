"""No path leads out of the folder, and what is wrong with one is a line."""

import pytest

from imdim.app.agent.workplace import Workplace
from imdim.reconstruction.config import ConfigError


@pytest.mark.parametrize("path", ["", "/etc/passwd", "../work2/a.stl", "plate/../../x", "C:\\x.stl", "\\x", "a\0b"])
def test_what_leads_out_is_refused(folder, path):
    for reach in (Workplace(folder).read_path, Workplace(folder).write_path):
        with pytest.raises(ConfigError) as refused:
            reach(path)
        assert "\n" not in str(refused.value)


def test_links_out_are_refused(folder, tmp_path):
    secret = tmp_path / "secret.stl"
    secret.write_text("solid")
    (folder / "link.stl").symlink_to(secret)
    (folder / "out").symlink_to(tmp_path)
    (folder / "loop").symlink_to(folder / "loop")
    for path in ("link.stl", "out/secret.stl", "out", "loop"):
        with pytest.raises(ConfigError):
            Workplace(folder).read_path(path)
    with pytest.raises(ConfigError):
        Workplace(folder).write_path("out/new")


def test_a_text_beside_a_program_is_no_link_out_either(folder, tmp_path):
    (tmp_path / "texts.scad").write_text("secret = 1;")
    (folder / "plate/program.scad").symlink_to(tmp_path / "texts.scad")
    for path in ("plate", "plate/program.json"):
        with pytest.raises(ConfigError, match="leads out"):
            Workplace(folder).read_path(path)


def test_what_is_inside_is_found(folder):
    (folder / "part2.stl").symlink_to(folder / "part.stl")
    workplace = Workplace(folder)
    assert workplace.read_path("part2.stl") == folder / "part.stl"
    assert workplace.list_parts() == ["part.stl", "part2.stl", "plate"]
    with pytest.raises(ConfigError, match="no such file"):
        workplace.read_path("gone.stl")
    with pytest.raises(ConfigError, match="inside"):
        workplace.write_path(".")


def test_a_root_that_is_no_folder_is_refused(folder):
    with pytest.raises(ConfigError, match="is no folder"):
        Workplace(folder / "part.stl")
