# SPDX-License-Identifier: LGPL-2.1-or-later
"""The libraries, commands and scenes of a wheel, which are in this folder."""

import glob
import os
import sys
import warnings

HERE = os.path.dirname(os.path.abspath(__file__))
LIBDIR = os.path.join(HERE, "lib")
DATADIR = os.path.join(HERE, "share")

_site = os.path.dirname(os.path.dirname(HERE))
_others = glob.glob(os.path.join(_site, "incise-*.dist-info"))
if _others:
    warnings.warn(
        f"{_others[0]}: the distribution incise, of another project, has a package incise too; its "
        "files and those of incise-haptics replace each other: pip uninstall incise, then pip install "
        "--force-reinstall incise-haptics",
        stacklevel=2,
    )


def main():
    """Become the command incise."""
    program = os.path.join(HERE, "bin", "incise")
    os.execv(program, [program] + sys.argv[1:])
