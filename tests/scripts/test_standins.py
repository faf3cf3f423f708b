"""The script that looks for boxes and cones that stand for blends tells each part."""

import sys
from pathlib import Path

from tests.planted import box, cut

from imdim.program.codec import dumps

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import standins

PLATE = box(60.0, 40.0, 10.0)
BEVEL = box(3.0, 50.0, 3.0, (30.0, 0.0, 5.0), (0.0, 45.0, 0.0))


def test_the_script_tells_each_part(tmp_path, monkeypatch, capsys):
    for name, program in (("bevelled", cut(PLATE, BEVEL)), ("plain", PLATE)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "program.json").write_text(dumps(program))
    monkeypatch.setattr(sys, "argv", ["standins.py", str(tmp_path)])
    assert standins.main() == 1
    said = capsys.readouterr().out
    assert "bevelled: 1 (box, 3 wide" in said
    assert "plain: none" in said
    assert "2 parts: 1 primitives stand for a chamfer or a fillet" in said
