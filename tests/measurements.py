"""Where measurements of other people's robots lie, which not every machine has."""

import os
from pathlib import Path

DATA = Path(os.environ.get("DRAKE_ISPACE_DATA", Path(__file__).parents[2] / "shared" / "data"))
ABSENT = f"the real measurements, {DATA}, are not here"
