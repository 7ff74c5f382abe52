"""Mitsuba's pictures of the built-in scenes, and the command that makes them."""
