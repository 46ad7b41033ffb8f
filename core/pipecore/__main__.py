"""``python -m pipecore``: the command line."""

import sys

from pipecore.cli import main

sys.exit(main())
