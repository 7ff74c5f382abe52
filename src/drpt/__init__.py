"""drpt: a small, fast, exact path tracer on Dr.Jit."""

import sys
from os.path import basename

if basename("".join(sys.orig_argv[-len(sys.argv) :][:1])) in ("drpt", "drpt-render", "-mdrpt"):
    # This is the program. From here on Ctrl-C ends it at once, without a traceback of its imports;
    # `drpt.cli` catches it later. Python's own `signal` takes milliseconds to be imported.
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
