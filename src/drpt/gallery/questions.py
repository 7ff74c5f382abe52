"""The course's questions, in the order of the page."""

from drpt.gallery.brightness import brightness
from drpt.gallery.fireflies import fireflies
from drpt.gallery.mirror import mirror
from drpt.gallery.sweep import sweep

QUESTIONS = (brightness, mirror, sweep, fireflies)
"""Each measures and answers one."""
