"""The same scene in Mitsuba 3, an independent renderer, and the statistics that compare."""

from drpt.crosscheck.check import Report, check
from drpt.crosscheck.compare import Comparison, compare
from drpt.crosscheck.convert import to_mitsuba, to_mitsuba_dict
from drpt.crosscheck.estimate import Estimate, measure, reference
from drpt.crosscheck.parse import from_mitsuba
from drpt.crosscheck.references import Reference, render_reference, stored_reference
from drpt.crosscheck.xml import to_mitsuba_xml

__all__ = [
    "Comparison",
    "Estimate",
    "Reference",
    "Report",
    "check",
    "compare",
    "from_mitsuba",
    "measure",
    "reference",
    "render_reference",
    "stored_reference",
    "to_mitsuba",
    "to_mitsuba_dict",
    "to_mitsuba_xml",
]
