"""drpt: a small, fast, exact path tracer on Dr.Jit."""

from drpt.distribution import VERSION
from drpt.render import (
    Explanation,
    Mode,
    Rendering,
    Result,
    explain,
    render,
)
from drpt.scene import (
    Camera,
    Diffuse,
    Mesh,
    Phong,
    Scene,
    SceneError,
    Sphere,
    load_scene,
    material_from_brdf_params,
)

__all__ = [
    "Camera",
    "Diffuse",
    "Explanation",
    "Mesh",
    "Mode",
    "Phong",
    "Rendering",
    "Result",
    "Scene",
    "SceneError",
    "Sphere",
    "explain",
    "load_scene",
    "material_from_brdf_params",
    "render",
]

__version__ = VERSION
