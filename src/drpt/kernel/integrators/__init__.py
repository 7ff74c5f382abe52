"""Path tracing: the loop over the vertices of a path, and how directions are chosen."""
