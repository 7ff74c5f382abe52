"""Fuzzers: whatever a file holds, drpt reads it or refuses it in one line that names it."""
