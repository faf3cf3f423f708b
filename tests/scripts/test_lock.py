"""A lock installs the archives that it was made of and no others, as pip itself judges."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "scripts"))
from lock import lock_lines, resolve

OFFLINE = ["--isolated", "--no-index", "--find-links"]


def write_wheel(folder, content):
    """A package of one module."""
    info = "tiny-1.0.dist-info"
    files = {
        "tiny.py": content,
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: tiny\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/RECORD": f"tiny.py,,\n{info}/METADATA,,\n{info}/WHEEL,,\n{info}/RECORD,,\n",
    }
    with zipfile.ZipFile(folder / "tiny-1.0-py3-none-any.whl", "w") as wheel:
        for name, text in files.items():
            wheel.writestr(zipfile.ZipInfo(name), text)


def install(folder, lock):
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", *OFFLINE, str(folder)]
    return subprocess.run([*command, "--require-hashes", "--no-deps", "-r", str(lock)], capture_output=True, text=True, timeout=120)


def test_a_locked_archive_is_taken_and_a_changed_one_refused(tmp_path):
    write_wheel(tmp_path, "value = 1\n")
    lock = tmp_path / "requirements.lock"
    lock.write_text("\n".join(lock_lines(resolve([*OFFLINE, str(tmp_path), "tiny"]))))
    assert str(tmp_path) not in lock.read_text(), "a lock names no place"
    assert install(tmp_path, lock).returncode == 0
    write_wheel(tmp_path, "value = 2\n")
    changed = install(tmp_path, lock)
    assert changed.returncode != 0
    assert "DO NOT MATCH THE HASHES" in changed.stderr


def test_folders_have_no_line_and_archives_without_a_hash_are_refused():
    def item(name, download):
        return {"metadata": {"name": name, "version": "1.0"}, "download_info": download}

    archive = {"archive_info": {"hashes": {"sha256": "ab"}}}
    assert lock_lines({"install": [item("Zoo", archive), item("imdim", {"dir_info": {}}), item("ant", archive)]}) == [
        "ant==1.0 --hash=sha256:ab",
        "Zoo==1.0 --hash=sha256:ab",
    ]
    with pytest.raises(ValueError, match=r"ant 1\.0"):
        lock_lines({"install": [item("ant", {"archive_info": {}})]})
