"""Path guiding: directions towards surfaces that reflect much light."""
