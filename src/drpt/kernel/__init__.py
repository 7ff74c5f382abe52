"""What runs on the device; all of drpt that knows Dr.Jit."""
