"""``python -m pipegui``."""

import sys

from pipegui.app import main

sys.exit(main())
