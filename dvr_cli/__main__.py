"""``python -m dvr_cli`` is ``dvr``."""

import sys

from dvr_cli.cli.main import main

sys.exit(main())
