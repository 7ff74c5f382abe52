"""A gallery of a few small pictures."""

import pytest

from drpt.gallery.figures import DIFFUSE, Crop, Curve, Figure, Plan, Row, Setting
from drpt.render import Mode

SIZE = 16


@pytest.fixture
def plan() -> Plan:
    rows = tuple(
        Row(tuple(Setting(DIFFUSE, Mode.EXPLICIT, sampler, spp, 1) for spp in (1, 16)))
        for sampler in ("sobol", "independent")
    )
    figure = Figure("A figure", "Words & <more>.", rows, (Crop("a place", 0.25, 0.5, 0.25),))
    return Plan(SIZE, (figure,), (Curve("A curve", DIFFUSE, 1, (Mode.EXPLICIT,), (1, 4)),))
