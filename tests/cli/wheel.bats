# SPDX-License-Identifier: GPL-2.0-or-later
# The metadata of the wheel, and the part that only a wheel has; make check-wheel installs it.

load cli

# bats test_tags=check
@test "wheel: versions, names and files of its metadata are those of the tree" {
	/usr/bin/python3 - "$root" <<'PYTHON'
import ast, glob, os, re, sys, tomllib

os.chdir(sys.argv[1])
read = lambda path: open(path).read()
project = tomllib.loads(read("pyproject.toml"))["project"]
version = re.search(r'INCISE_VERSION "(.*)"', read("lib/include/incise/version.h"))[1]
assert f'VERSION = "{version}"' in read("python/incise/_library.py"), version
assert project["name"] == "incise-haptics" and project["scripts"]["incise"] == "incise._installed:main"
assert project["authors"][0]["name"] in read("CITATION.cff")
assert os.path.exists(project["readme"])
assert all(glob.glob(pattern) for pattern in project["license-files"])
for line in read("MANIFEST.in").splitlines():
    word, *names = line.split()
    assert word == "#" or all(map(os.path.exists, names)), line
# Its oldest Python parses every module.
oldest = tuple(map(int, project["requires-python"].removeprefix(">=").split(".")))
for path in glob.glob("python/incise/*.py") + ["mk/wheel/installed.py", "setup.py"]:
    ast.parse(read(path), path, feature_version=oldest)
PYTHON
}

# bats test_tags=check
@test "wheel: its libraries come first, its command runs, another distribution incise is said" {
	mkdir site
	cp -r "$root/python/incise" site
	mkdir site/incise/_installed
	cp "$root/mk/wheel/installed.py" site/incise/_installed/__init__.py
	ln -s "$INCISE_BUILD/bin" "$INCISE_BUILD/lib" "$INCISE_BUILD/share" site/incise/_installed
	export PYTHONPATH="$PWD/site" PYTHONDONTWRITEBYTECODE=1
	run -0 /usr/bin/python3 -c 'from incise._library import _folders; print(next(_folders()))'
	[ "$output" = "$PWD/site/incise/_installed/lib" ] || complain "$output"
	run -0 --separate-stderr /usr/bin/python3 -c 'from incise._installed import main; main()' --version
	[[ "$output" = "incise "* && -z "$stderr" ]] || complain "$output $stderr"
	mkdir site/incise-2.0.dist-info
	run -0 --separate-stderr /usr/bin/python3 -c 'from incise._installed import main; main()' --version
	[[ "$stderr" = *"site/incise-2.0.dist-info: the distribution incise, of another project, "*"pip uninstall incise, then pip install --force-reinstall incise-haptics"* ]] ||
		complain "$stderr"
}
