"""Fuzzers: drpt must read any file, or refuse it with one line that names the file."""
