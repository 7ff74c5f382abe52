from xml.etree.ElementTree import fromstring

import pytest

from drpt.gallery.charts import BOTTOM, LEFT, RIGHT, TOP, log_log


def test_points_stand_where_their_logarithms_are() -> None:
    """In the middle of two decades, and in the corners of all."""
    svg = fromstring(log_log("A & B", "x", "y", {"a": [(1, 100), (10, 10), (100, 1)]}))
    marks = [(float(c.attrib["cx"]), float(c.attrib["cy"])) for c in svg.iter("circle")]
    middle = (LEFT + RIGHT) / 2, (TOP + BOTTOM) / 2
    expected = [(LEFT, TOP), middle, (RIGHT, BOTTOM)]
    assert marks == [pytest.approx(place, abs=0.05) for place in expected]  # written with 0.1
    assert svg.attrib["aria-label"] == "A & B"
    assert [text.text for text in svg.iter("text")][:3] == ["10⁰", "10¹", "10²"]


def test_what_has_no_logarithm_is_left_out() -> None:
    svg = fromstring(log_log("", "", "", {"a": [(1, 0.0), (1, -1.0), (2, 5)], "b": [(3, 4)]}))
    assert len(list(svg.iter("circle"))) == 2
