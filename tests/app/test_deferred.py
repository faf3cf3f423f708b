"""Modules that a fit seldom uses are loaded when they are used, in a process of their own, in which nothing is loaded yet."""

import subprocess
import sys

import pytest

IMPORTED = """
import sys
from imdim.app.deferred import SELDOM, defer_modules
with defer_modules():
    import imdim.reconstruction.pipeline, imdim.delivery.deliver, trimesh, trimesh.nsphere
def loaded():
    names = "networkx.algorithms", "numpy.f2py.f2py2e", "yaml.loader"
    names += "scipy.ndimage._ndimage_api", "scipy.optimize._optimize", "scipy.special._basic"
    return [name for name in names if name in sys.modules]
assert not loaded(), loaded()
assert not set(SELDOM) & set(sys.modules)
"""
USED = {
    "by those that took a function": """
ball = trimesh.creation.icosphere(subdivisions=1)
center, radius, error = trimesh.nsphere.fit_nsphere(ball.vertices)
assert abs(radius - 1) < 1e-9 and loaded() == ["scipy.optimize._optimize", "scipy.special._basic"]
""",
    "by those that took the module": """
from imdim.search.mdl.curve_tracing import ndimage
import numpy as np
assert ndimage.binary_fill_holes(np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])).all()
assert loaded() == ["scipy.ndimage._ndimage_api", "scipy.special._basic"]
""",
    "by trimesh": """
mesh = trimesh.creation.box()
mesh.faces[0] = mesh.faces[0][::-1]
mesh.fix_normals()
assert mesh.is_winding_consistent and mesh.volume == 1
""",
    "by relations in noise": """
import math
from imdim.relations.discover import gammaincinv
assert abs(gammaincinv(1.0, 0.5) - math.log(2)) < 1e-12 and loaded() == ["scipy.special._basic"]
""",
    "as what its package holds": """
import numpy, scipy
assert callable(numpy.f2py.get_include) and callable(scipy.special.erf) and loaded() == ["numpy.f2py.f2py2e", "scipy.special._basic"]
""",
    "by those that import it later": """
import networkx, yaml
from numpy import f2py
from scipy import ndimage, optimize, special
from scipy.optimize import milp
assert networkx.Graph.__name__ == "Graph" and isinstance(optimize.Bounds, type) and len(loaded()) == 6
assert yaml.safe_load("a: 1") == {"a": 1}
""",
}


@pytest.mark.parametrize("used", USED)
def test_what_is_seldom_used_is_loaded_when_it_is_used(used):
    done = subprocess.run([sys.executable, "-W", "error", "-c", IMPORTED + USED[used]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
