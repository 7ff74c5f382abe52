"""The smallest faults that a check finds, as a table: ``python -m benchmarks.faults``.

Each kind of fault is injected into what drpt renders, in ever smaller sizes, and the check of
``drpt check`` runs at its default sample count. Three minutes on two cores.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from drpt.crosscheck import Comparison, Reference, compare, render_reference
from drpt.crosscheck.check import light_edges
from drpt.crosscheck.references import SPP
from tests.crosscheck.faults import BOUNCE, BOUNCES, FAULTS, WHOLE, Fault, scenes

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SHRINK = 2**-0.5
"""From one size to the next."""


def main() -> None:
    """Print the table."""
    print(f"{SPP} spp, {BOUNCES} bounces\n")
    print("| fault | scene | pixels | mode | must find | smallest found | by |")
    print("|---|---|---|---|---|---|---|")
    for fault in FAULTS:
        size, tests = smallest(fault)
        sizes = (shown(s, fault.unit) for s in (fault.size, size))
        camera = scenes()[fault.scene].camera
        pixels = f"{camera.width}²"
        cells = fault.name, fault.scene, pixels, fault.mode, *sizes, tests
        print(f"| {' | '.join(cells)} |", flush=True)


def shown(size: float, unit: str) -> str:
    """A size with its unit, shares of a whole in percent."""
    if unit == WHOLE:
        return f"{100 * size:.2g} % of it"
    return f"{abs(size):.2g} {unit}"


def smallest(fault: Fault) -> tuple[float, str]:
    """The smallest size that is found, all larger ones being found, and which tests find it."""
    size, found = fault.size, checked(fault, fault.size)
    if found.passed:
        return float("nan"), "not found"
    while fault.unit != BOUNCE and not (smaller := checked(fault, size * SHRINK)).passed:
        size, found = size * SHRINK, smaller
    passed = {"means": found.of_image.passed, "blocks": found.of_blocks.passed}
    return size, " and ".join(name for name, test_passed in passed.items() if not test_passed)


def checked(fault: Fault, size: float) -> Comparison:
    """What a check says of a fault."""
    against, edges = reference(fault.scene)
    image = fault.render(size)
    return compare(image, against.estimate, edges=edges, tolerance=against.tolerance)


@cache
def reference(name: str) -> tuple[Reference, NDArray[np.bool_]]:
    """Mitsuba's picture of a scene, and the edges of its lights."""
    scene = scenes()[name]
    return render_reference(scene, SPP, BOUNCES), light_edges(scene, SPP)


if __name__ == "__main__":
    main()
