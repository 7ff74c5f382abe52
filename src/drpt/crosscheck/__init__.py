"""The same scene in Mitsuba 3, an independent renderer to compare with."""

from drpt.crosscheck.convert import to_mitsuba, to_mitsuba_dict
from drpt.crosscheck.reference import reference

__all__ = ["reference", "to_mitsuba", "to_mitsuba_dict"]
