"""Where scenes and data that others made are, if they are."""

import os
from pathlib import Path

DATA = Path(os.environ.get("COCAP_OPT_DATA", Path(__file__).parents[3] / "shared" / "data"))
