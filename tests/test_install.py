"""What messages tell people to type, for each way in which the package may have been installed."""

import json
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import imdim
from imdim import install
from imdim.app.cli import main


class Installed:
    """Stands in for the installed distribution with its direct_url.json (PEP 610)."""

    def __init__(self, origin):
        self.origin = origin

    def read_text(self, name):
        assert name == "direct_url.json"
        return None if self.origin is None else json.dumps(self.origin)


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        (None, 'pip install "imdim[step]"'),
        ({"url": "https://host/imdim.whl", "archive_info": {}}, 'pip install "imdim[step]"'),
        ({"url": "file:///home/a%20b/imdim-0.1.0.whl", "archive_info": {}}, 'pip install "imdim[step]"'),
        ({"url": "file:///home/a%20b/imdim", "dir_info": {"editable": True}}, 'pip install -e "/home/a b/imdim[step]"'),
        ({"url": "file:///home/imdim", "dir_info": {}}, 'pip install "/home/imdim[step]"'),
    ],
)
def test_the_command_is_that_of_the_install(monkeypatch, origin, said):
    monkeypatch.setattr(install, "distribution", lambda name: Installed(origin))
    monkeypatch.setattr(install.shutil, "which", lambda name: str(Path(sys.executable).with_name("pip")))
    assert install.install_command("step") == said


def test_in_the_source_folder_it_is_a_dot(monkeypatch, tmp_path):
    origin = {"url": tmp_path.as_uri(), "dir_info": {"editable": True}}
    monkeypatch.setattr(install, "distribution", lambda name: Installed(origin))
    monkeypatch.chdir(tmp_path)
    assert install.install_command("lab").endswith('pip install -e ".[lab]"')


def test_a_source_tree_that_was_not_installed(monkeypatch):
    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(install, "distribution", missing)
    monkeypatch.chdir(install.SOURCE)
    assert install.install_command("lab").endswith('pip install -e ".[lab]"')


def test_the_interpreter_is_named_where_pip_is_another_ones(monkeypatch):
    monkeypatch.setattr(install, "distribution", lambda name: Installed(None))
    monkeypatch.setattr(install.shutil, "which", lambda name: "/usr/bin/pip")
    assert install.install_command("step") == f'{sys.executable} -m pip install "imdim[step]"'
    monkeypatch.setattr(install, "find_spec", lambda name: None)
    assert install.install_command("step") == 'uv pip install "imdim[step]"'


def test_python_m_is_the_command():
    said = subprocess.run([sys.executable, "-m", "imdim", "--version"], capture_output=True, text=True, check=True).stdout
    assert said == f"imdim {imdim.__version__}\n"


def test_a_command_of_a_source_tree_that_was_never_installed_has_no_version(monkeypatch, capsys):
    """It ended in a traceback, whatever the command."""

    def lack(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", lack)
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == "imdim unknown\n"
