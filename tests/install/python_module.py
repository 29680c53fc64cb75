# SPDX-License-Identifier: Apache-2.0
"""python_module.py PLACE [VERSION]: the module that is installed there, and what belongs to it."""

import json
import sys
import tempfile
from pathlib import Path

import kinescope

place = Path(sys.argv[1]).resolve()
assert Path(kinescope.__file__).resolve().parent == place / "kinescope", kinescope.__file__
assert sys.argv[2:] in ([], [kinescope.__version__]), kinescope.__version__
assert (place / "kinescope" / "py.typed").is_file()
with tempfile.TemporaryDirectory() as folder:
    sheet = Path(folder) / "markers.pdf"
    result = kinescope.markers(ids="0-7", size=0.04, output=sheet)
    assert sheet.read_bytes().startswith(b"%PDF"), "no PDF"
    assert Path(result["pdf"]) == sheet, json.dumps(result)
