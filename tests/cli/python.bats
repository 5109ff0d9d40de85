# SPDX-License-Identifier: GPL-2.0-or-later
# incise for Python: its tests by the system's Python with Debian's numpy and pandas, by one without
# any package, and with foreign readers of Arrow streams from pip.

load cli

setup() {
	export PYTHONPATH="$root/python" PYTHONDONTWRITEBYTECODE=1
	cd "$root/tests/python"
	peers="$INCISE_BUILD/tests/python/venv/bin/python"
}

# Run test modules; print what was skipped.
python_tests() {
	run "$@"
	grep -E "skipped [^0-9]" <<<"$output" | sed 's/^/# /' >&3 || :
	[ "$status" = 0 ] || { echo "$output"; false; }
	[[ "$output" == *OK* ]]
}

# The examples of the README, as a program.
readme_code() {
	sed -n '/^```python$/,/^```$/p' "$root/python/README.md" | sed '/^```/d'
}

# bats test_tags=check
@test "python: structs and functions are those of the headers" {
	run -0 /usr/bin/python3 abi.py "${CC:-cc}"
	[[ "$output" == *" structs, "*" fields" ]]
}

@test "python: recordings, with Debian's packages" {
	python_tests /usr/bin/python3 -m unittest -v test_recording
}

@test "python: models, scenes and calibrations, with Debian's packages" {
	python_tests /usr/bin/python3 -m unittest -v test_model test_plan test_host test_names test_typed
}

@test "python: without any package" {
	# -S leaves out dist-packages, and so numpy
	run /usr/bin/python3 -S -c 'import numpy'
	[ "$status" = 1 ]
	python_tests /usr/bin/python3 -S -m unittest -v test_plan test_host test_recording.Import \
		test_recording.Recordings.test_streams_are_the_blocks \
		test_recording.Recordings.test_pairs_are_those_of_the_tool \
		test_model.Models.test_forms_of_inputs test_model.Models.test_wrong_inputs
}

@test "python: pyarrow, Parquet, polars, DuckDB and pandas 3 read the streams" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	python_tests "$peers" -m unittest -v test_foreign
}

@test "python: MuJoCo, by attach() and by the plugin" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	python_tests "$peers" -m unittest -v test_mujoco
	grep 'us$' <<<"$output" | sed 's/^/# /' >&3
}

@test "python: scikit-learn's protocol" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	python_tests "$peers" -m unittest -v test_model.Estimator
}

@test "python: what researchers type works, or raises one clear line" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	python_tests "$peers" -m unittest -v test_typed
}

@test "python: examples and notebooks pass mypy --strict" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	cd "$BATS_TEST_TMPDIR"
	readme_code >readme.py
	# The types of MuJoCo are in a compiled module that mypy does not read.
	printf '[mypy]\n[mypy-mujoco.*]\nfollow_imports = skip\n' >mypy.ini
	for program in readme.py "$root"/examples/*.py "$root"/examples/mujoco/*.py "$root"/doc/notebooks/*.py; do
		MYPYPATH="$root/python" run -0 "$peers" -m mypy --strict --follow-imports=silent \
			--ignore-missing-imports "$program"
	done
}

# Cells are comments: the same file is a program. make notebooks runs it as a notebook.
@test "python: notebooks run" {
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	cd "$BATS_TEST_TMPDIR"
	for notebook in "$root"/doc/notebooks/*.py; do
		echo "$notebook"
		MPLBACKEND=Agg run -0 "$peers" "$notebook"
	done
	[[ "$output" == *"largest difference"*" mN"* ]]
}

@test "python: the examples of its README" {
	command -v incise
	cd "$BATS_TEST_TMPDIR"
	incise capture -o liver.rec --rig sim:seed=1,clock=simulated
	readme_code >readme.py
	[ "$(wc -l <readme.py)" -gt 15 ]
	[ -x "$peers" ] || skip "pip could not install tests/python/requirements.txt"
	run -0 "$peers" readme.py
	[ -s liver.fis.sd ]
	[ -s liver.fx ]
	run -0 /usr/bin/python3 "$root/examples/learn.py" liver.rec b.fis
	cmp liver.fis b.fis
	[[ "$output" == "rms error on unseen cuts "*"15 mm, 20 mm/s: "* ]]
	run -1 --separate-stderr /usr/bin/python3 "$root/examples/learn.py" none.rec b.fis
	[ "$stderr" = "learn.py: none.rec: no such recording; check name and folder" ]
}
