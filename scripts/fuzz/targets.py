"""What is fuzzed: each kind of file with its valid examples, its reader and its share of the cases."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from kind import Kind, refused
from learning import policies, read_policy, read_sample, read_state, samples, states
from odd_shapes import load_named, names, objects, offs, plys, polygons, print_files, scenes
from programs import delivered, edit, export, fronts, programs, read_front, read_program
from shapes import load, meshes, npys, npzs, pcds, ply_clouds, texts


def settings(_: Path) -> list[bytes]:
    return [b"budget_s=3\nseed=1\nmethod=tree\nsize_weight=0.001\ncheckpoint=none\nlogdir=a/b", b"segments=12\nstump_checkpoint='x y'"]


def read_settings(path: Path) -> bool:
    from imdim.reconstruction.config import ConfigError, from_arguments

    return refused((ConfigError,), lambda: from_arguments(path.read_bytes().decode("utf-8", "replace").split("\n")))


KINDS: Mapping[str, Kind] = {
    "stl": Kind(".stl", "bytes", 60, meshes("stl"), load),
    "stl_ascii": Kind(".stl", "bytes", 50, meshes("stl_ascii"), load),
    "obj": Kind(".obj", "bytes", 70, meshes("obj"), load),
    "off": Kind(".off", "bytes", 60, meshes("off"), load),
    "ply": Kind(".ply", "bytes", 50, meshes("ply"), load),
    "ply_ascii": Kind(".ply", "bytes", 40, meshes("ply", encoding="ascii"), load),
    "ply_cloud": Kind(".ply", "bytes", 40, ply_clouds, load),
    "3mf": Kind(".3mf", "zip", 70, meshes("3mf"), load),
    "glb": Kind(".glb", "glb", 70, meshes("glb"), load),
    "obj_objects": Kind(".obj", "bytes", 50, objects, load),
    "off_polygons": Kind(".off", "bytes", 40, polygons(offs), load),
    "ply_polygons": Kind(".ply", "bytes", 60, polygons(plys), load),
    "3mf_print": Kind(".3mf", "zip", 40, print_files, load),
    "glb_scene": Kind(".glb", "glb", 70, scenes, load),
    "name": Kind(".name", "bytes", 30, names, load_named),
    "xyz": Kind(".xyz", "bytes", 40, texts, load),
    "csv": Kind(".csv", "bytes", 40, texts, load),
    "pcd": Kind(".pcd", "bytes", 80, pcds, load),
    "npy": Kind(".npy", "npy", 50, npys, load),
    "npz": Kind(".npz", "zip", 50, npzs, load),
    "program": Kind(".json", "json", 80, programs, read_program),
    "front": Kind(".json", "json", 30, fronts, read_front),
    "export": Kind(".json", "json", 30, lambda f: [*programs(f), *fronts(f)], export),
    "edit": Kind(".edit", "edit", 30, delivered, edit),
    "policy": Kind(".safetensors", "safetensors", 40, policies, read_policy),
    "state": Kind(".pt", "zip", 20, states, read_state),
    "sample": Kind(".npz", "zip", 40, samples, read_sample),
    "settings": Kind(".txt", "bytes", 20, settings, read_settings),
}
