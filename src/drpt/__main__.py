"""`python -m drpt` is `drpt`."""

import sys

from drpt.cli import main

sys.exit(main())
