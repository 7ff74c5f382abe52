"""Scenes on the host: the model, its files, and the built-in scenes."""

from drpt.scene.builtin import builtin_names
from drpt.scene.checks import SceneError
from drpt.scene.files import load_scene
from drpt.scene.materials import Diffuse, Material, Mirror, Phong
from drpt.scene.model import (
    Camera,
    Mesh,
    Scene,
    Shape,
    Sphere,
    material_from_brdf_params,
)

__all__ = [
    "Camera",
    "Diffuse",
    "Material",
    "Mesh",
    "Mirror",
    "Phong",
    "Scene",
    "SceneError",
    "Shape",
    "Sphere",
    "builtin_names",
    "load_scene",
    "material_from_brdf_params",
]
