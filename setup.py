# SPDX-License-Identifier: LGPL-2.1-or-later
"""The C libraries and commands of a wheel, which `make bundle` builds; pyproject.toml states the rest.

INCISE_BUNDLE names a folder that `make bundle` has written, for another system: `make wheel` sets it.
"""

import os
import re
import shutil
import subprocess

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py


class BuildWithBundle(build_py):
    def run(self):
        super().run()
        if self.editable_mode:
            return  # the package finds build/lib itself
        bundle = os.path.abspath(os.path.join(self.build_lib, "incise", "_installed"))
        made = os.environ.get("INCISE_BUNDLE")
        if made:
            shutil.copytree(made, bundle)
        else:
            jobs = f"-j{os.cpu_count() or 1}"
            subprocess.run(["make", jobs, "bundle", f"BUNDLE={bundle}"], check=True)


class OneArchitecture(Distribution):
    def has_ext_modules(self):
        return True


class AnyPython(bdist_wheel):
    """ctypes loads the libraries, so that a wheel serves every Python of one architecture."""

    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


def project_urls():
    """Addresses of mk/project.mk; make exports those that are given to it."""
    with open("mk/project.mk", encoding="utf-8") as file:
        stated = dict(re.findall(r"^PROJECT_(\w+) \?= *(.*)$", file.read(), re.M))
    urls = {name: os.environ.get(f"PROJECT_{name}") or value for name, value in stated.items()}
    labels = {"HOME": "Homepage", "TRACKER": "Tracker", "CONTACT": "Contact"}
    urls = {labels[name]: url for name, url in urls.items() if url}
    if "@" in urls.get("Contact", ""):
        urls["Contact"] = "mailto:" + urls["Contact"]
    return urls


setup(
    project_urls=project_urls(),
    distclass=OneArchitecture,
    cmdclass={"build_py": BuildWithBundle, "bdist_wheel": AnyPython},
    options={"build": {"build_base": "build/python"}},  # build/lib is make's
)
