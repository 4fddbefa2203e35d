"""`python -m inphase.cli`, the same as `inphase`."""

import sys

from inphase.cli import main

sys.exit(main())
