"""Float64 NumPy reference for the tests, written from the definitions alone.

Nothing here knows drpt's kernels, Dr.Jit or Mitsuba: only the scene model is shared. Directions
are unit vectors that point away from the surface: ω_o to the viewer, ω_i to the incident light.
"""
