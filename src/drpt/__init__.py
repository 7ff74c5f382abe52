"""drpt: a small, fast, exact path tracer on Dr.Jit."""

import sys
from os.path import basename

if basename("".join(sys.orig_argv[-len(sys.argv) :][:1])) in ("drpt", "drpt-render", "-mdrpt"):
    # This process is the command. Until `drpt.cli` handles Ctrl-C, it ends the process at once,
    # without a traceback of the imports. Importing Python's `signal` would take milliseconds.
    import _signal  # type: ignore[import-not-found]

    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

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
    Mirror,
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
    "Mirror",
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
