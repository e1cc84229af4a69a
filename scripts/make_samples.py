#!/usr/bin/env python3
"""Write the sample files anew: make_samples.py [DIR], by default data_samples/ beside this folder."""

import sys
from pathlib import Path

from o3dleaf.samples.files import write_samples

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "data_samples"
for path in write_samples(folder):
    print(path)
