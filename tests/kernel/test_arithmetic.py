"""The same bits with vectors of any width, and whatever arithmetic the caller has chosen.

The CPU's approximate reciprocal square root differs between vectors of 8 and of 16 numbers. No
kernel has it while FastMath is off, which is shown on every CPU; vectors of 16 numbers are compared
with those of 8 where the CPU has AVX-512, and else those of 4.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np
import pytest

import drpt
from drpt.kernel.arithmetic import same_bits
from drpt.kernel.launch import forget
from tests.conftest import TYPES
from tests.scenes import seen_by

PICTURES = (
    "cornell-box mis",
    "cornell-box guided",
    "cornell-box-glossy mis",
    "spheres implicit-uniform",
    "many-lights mis",
    "veach explicit",
    "veach layers",
)
RENDER = """
import ctypes, hashlib, sys
from pathlib import Path
import drpt
from drpt.kernel import backend
from tests.scenes import seen_by

backend.load("llvm")
import drjit as dr
core = ctypes.CDLL(str(next(Path(dr.__file__).parent.glob("libdrjit-core.*"))))
text = ctypes.CFUNCTYPE(ctypes.c_char_p)
cpu = text(("_Z19jit_llvm_target_cpuv", core))()
features = text(("_Z24jit_llvm_target_featuresv", core))()
core["_Z19jit_llvm_set_targetPKcS0_j"](cpu, features, int(sys.argv[1]))
assert backend.describe().vector_width == int(sys.argv[1])
for picture in sys.argv[2:]:
    name, mode = picture.split()
    scene = seen_by(drpt.load_scene(name), 40, 30)
    rendering = drpt.Rendering(scene, 8, 3, "mis" if mode == "layers" else mode)
    if mode == "layers":
        bits = b"".join(layer.tobytes() for layer in rendering.first_hits().values())
    else:
        for _ in rendering.passes():
            pass
        bits = rendering.result().image.tobytes()
    print(picture, hashlib.sha256(bits).hexdigest())
"""


def other_width() -> int:
    return 16 if "avx512f" in Path("/proc/cpuinfo").read_text().split() else 4


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="of x86-64 under Linux"
)
def test_vectors_of_another_width() -> None:
    command = [sys.executable, "-c", RENDER]
    runs = [
        subprocess.Popen([*command, str(width), *PICTURES], stdout=subprocess.PIPE, text=True)
        for width in (8, other_width())
    ]
    eight, other = (run.communicate()[0].splitlines() for run in runs)
    assert [line.rpartition(" ")[0] for line in eight] == list(PICTURES)
    assert len({line.rpartition(" ")[2] for line in eight}) == len(PICTURES)
    assert other == eight


def bits_of_all(*, fast: bool) -> list[bytes]:
    """Results of each way to run kernels, with a setting of the caller's."""
    forget()
    scene = seen_by(drpt.load_scene("cornell-box-glossy"), 8, 8)
    with dr.scoped_set_flag(dr.JitFlag.FastMath, fast):
        rendering = drpt.Rendering(scene, 4, 2, "guided")
        for _ in rendering.passes():
            pass
        arrays: list[np.ndarray[Any, Any]] = [
            rendering.result().image,
            rendering.sample(3, 4, 2),
            *vars(rendering.vertices(3, 4, 4)).values(),
            *rendering.first_hits().values(),
            np.array(rendering.launcher.operations()),
        ]
        assert dr.flag(dr.JitFlag.FastMath) == fast
    return [array.tobytes() for array in arrays]


def test_the_arithmetic_of_the_caller_changes_nothing() -> None:
    assert bits_of_all(fast=True) == bits_of_all(fast=False)


def test_a_kernel_of_the_caller_has_the_arithmetic_that_was_asked_for() -> None:
    """So the test above sees a launch that forgets about it."""
    x = TYPES.Float32(np.linspace(1, 2, 1000, dtype=np.float32))
    with dr.scoped_set_flag(dr.JitFlag.FastMath, True):
        fast = dr.rsqrt(x).numpy()
        with same_bits():
            exact = dr.rsqrt(x).numpy()
    assert not np.array_equal(fast, exact)
    assert np.array_equal(exact, dr.sqrt(1 / x).numpy())


def test_denormals_are_0_on_the_calling_thread() -> None:
    with same_bits():
        assert np.float32(1e-30) * np.float32(1e-10) == 0
    assert np.float32(1e-30) * np.float32(1e-10) > 0
