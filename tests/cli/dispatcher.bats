# SPDX-License-Identifier: GPL-2.0-or-later
# incise itself: finding and running verbs.

load cli

# bats test_tags=check
@test "--help and help list the verbs, in groups, twenty at most" {
	run -0 --separate-stderr incise help advanced
	for verb in bench feed join tool; do
		grep -q "^  $verb  *[a-z]" <<<"$output"
	done
	run -0 --separate-stderr incise --help
	[ "$(grep -c '^  [a-z]' <<<"$output")" -le 20 ]
	[ -z "$stderr" ]
	help=$output
	for verb in capture export train eval info haptic demo; do
		grep -q "^  $verb  *[a-z]" <<<"$help"
		[ -x "$INCISE_BUILD/bin/incise-$verb" ]
	done
	run -0 incise help
	[ "$output" = "$help" ]
	run -0 incise -h
	[ "$output" = "$help" ]
}

# bats test_tags=check
@test "every program that is built is a verb of --help, or a word of one" {
	for program in "$INCISE_BUILD"/bin/incise-*; do
		name=${program##*/incise-}
		if [[ $name == *-* ]]; then
			"incise-${name%%-*}" --help | grep -qE "^ *${name#*-}[: ]"
			run -0 incise "${name%%-*}" "${name#*-}" --help
			[[ "${lines[0]}" == "Usage: incise ${name/-/ } "* ]]
		else
			{ incise --help && incise help advanced; } | grep -q "^  $name "
		fi
	done
}

# bats test_tags=check
@test "--version is the header's" {
	header=$(sed -n 's/^#define INCISE_VERSION "\(.*\)"/\1/p' \
		"$root/lib/include/incise/version.h")
	[ -n "$header" ]
	run -0 --separate-stderr incise --version
	[ "${lines[0]}" = "incise $header" ]
	[ -z "$stderr" ]
	features=$output
	run -0 incise -V
	[ "$output" = "$features" ]
}

@test "--version lists the modules that are there, and why one cannot be loaded" {
	run -0 --separate-stderr incise --version
	[ "${lines[-1]}" = "  modules    $INCISE_BUILD/lib/incise" ]
	[[ "$output" =~ $'\n'"  sqlite     "$(sqlite3 --version | cut -d" " -f1)$'\n' ]]
	view=no
	[ ! -e "$INCISE_BUILD/lib/libincise-view.so" ] || view=yes
	grep -qx "  view       $view" <<<"$output"
	for module in "$INCISE_BUILD"/lib/incise/*_*.so; do
		[[ "$module" != */peer_* ]] || continue
		name=$(basename "$module" .so)
		grep -qE "^  [a-z]+ +.*\<${name#*_}\>" <<<"$output" || complain "$name is missing"
	done
	[ ! -e "$INCISE_BUILD/lib/incise/stepper_gpio.so" ] || [[ "$output" == *"gpio (libgpiod "[12].* ]]
	# another folder: nothing but what is built in, and a module that is none
	mkdir modules
	: >modules/tracker_empty.so
	INCISE_MODULE_PATH=$PWD/modules run -0 --separate-stderr incise --version
	grep -qE '^  trackers   empty \(.*tracker_empty.so: file too short' <<<"$output"
	grep -qx '  cameras    none' <<<"$output"
	grep -qx '  steppers   none' <<<"$output"
	[ "${lines[-1]}" = "  modules    $PWD/modules" ]
	run -1 --separate-stderr bash -c "incise --version >/dev/full"
	[ "${#stderr_lines[@]}" -eq 1 ]
}

# bats test_tags=check
@test "no verb, and words that are none" {
	# a folder that may not be searched would be another error
	PATH=$INCISE_BUILD/bin:/usr/bin:/bin
	run -2 --separate-stderr incise
	[ -z "$output" ]
	[[ "$stderr" == "Usage: incise COMMAND"*"  demo "* ]]
	for word in nosuch --nosuch ../bin/incise-train "" "$(printf 'x%.0s' {1..5000})"; do
		run -2 --separate-stderr incise "$word"
		[ -z "$output" ]
		[ "${#stderr_lines[@]}" -eq 1 ]
		[[ "$stderr" == *"incise --help"* || "$stderr" == *"did you mean"* ]]
	done
	run -2 --separate-stderr incise rig
	[ "$stderr" = "incise: 'rig': is now 'incise info rig'" ]
	run -2 --separate-stderr incise record
	[[ "$stderr" == *"did you mean 'incise capture'?" ]]
}

# bats test_tags=check
@test "a verb of someone else's on PATH runs with its arguments" {
	mkdir bin
	printf '#!/bin/sh\nprintf "%%s|" "$0" "$@"\nexit 7\n' >bin/incise-weigh
	chmod +x bin/incise-weigh
	PATH=$PWD/bin:$PATH run -7 incise weigh "a b" --x ""
	[ "$output" = "$PWD/bin/incise-weigh|a b|--x||" ]
}

@test "a verb on PATH does not hide the one beside incise" {
	mkdir bin
	printf '#!/bin/sh\necho false friend\n' >bin/incise-train
	chmod +x bin/incise-train
	PATH=$PWD/bin:$PATH run -0 incise train --version
	[[ "$output" == "incise "[0-9]* ]]
}

@test "a verb that may not be run is 1" {
	mkdir bin
	echo nonsense >bin/incise-weigh
	PATH=$PWD/bin:$PATH run -1 --separate-stderr incise weigh
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$stderr" == *incise-weigh* ]]
}

@test "incise runs from anywhere, and through a link" {
	cd /
	run -0 "$INCISE_BUILD/bin/incise" train --version
	ln -s "$INCISE_BUILD/bin/incise" "$BATS_TEST_TMPDIR/work/link"
	PATH=/usr/bin:/bin run -0 "$BATS_TEST_TMPDIR/work/link" train --version
	[[ "$output" == "incise "* ]]
}

# bats test_tags=check
@test "help VERB opens the manual of the build tree" {
	mkdir bin
	printf '#!/bin/sh\necho "man $*"\n' >bin/man
	chmod +x bin/man
	while read -r words page; do
		# shellcheck disable=SC2086 # "calibrate,force" is two words
		PATH=$PWD/bin:$PATH run -0 incise help ${words//,/ }
		[ "$(realpath "${output#man }")" = "$(realpath "$INCISE_BUILD/man/$page")" ] || complain "$words: $output"
	done <<-END
		train incise-train.1
		calibrate,force incise-calibrate-force.1
		calibrate-force incise-calibrate-force.1
		incise-calibrate-force incise-calibrate-force.1
		bench,precision incise-bench-precision.1
		rig.conf rig.conf.5
		scene incise-scene.5
		incise-scene incise-scene.5
		library libincise.3
		incise-haptic@.service incise-haptic@.service.8
	END
	for page in lesson glossary FAQ; do
		[ "$(incise help $page)" = "$(realpath "$BATS_TEST_DIRNAME/../../doc/${page,,}.md")" ] || complain "$page"
	done
	run -2 --separate-stderr incise help rig.con
	[ "$stderr" = \
		"incise: help rig.con: no such command or file format; did you mean 'incise help rig.conf'?" ]
}

@test "help on a full disk says so" {
	for word in --help --version help; do
		run --separate-stderr bash -c "incise $word >/dev/full"
		[ "$status" -eq 1 ]
		[ "${#stderr_lines[@]}" -eq 1 ]
	done
}

# What it measures is in bench*.bats.
# bats test_tags=check
@test "a report of a benchmark is compared with itself; what is none, and no benchmark, are refused" {
	incise bench precision "$root/scenes/liver.fis" --quick --json >r.json 2>/dev/null
	run -0 --separate-stderr incise bench compare r.json r.json
	[ -z "$stderr" ]
	fails incise bench compare r.json "$root/scenes/liver.fis" -- liver.fis
	misused incise bench nosuch -- "unknown benchmark 'nosuch'"
}

# bats test_tags=check
@test "an output whose reader has gone is no full disk" {
	(
		trap '' PIPE
		{
			until [ -e gone ]; do sleep 0.02; done
			code=0
			# more than stdio holds, so that an earlier write has failed
			incise info "$root/scenes/liver.fis" --json 2>err || code=$?
			echo $code >code
		} | {
			exec <&-
			touch gone
		}
	)
	[ "$(cat code)" = 1 ]
	[ ! -s err ] || complain "$(cat err)"
}

@test "a command that was left out of the build names its packages" {
	mkdir bin
	cp "$INCISE_BUILD/bin/incise" bin
	PATH=/usr/bin:/bin LD_LIBRARY_PATH=$INCISE_BUILD/lib run -2 --separate-stderr bin/incise serve
	[ "$stderr" = "incise: 'serve': this incise was built without it; apt-get install libopenigtlink-dev, and build it again" ] || complain "$stderr"
	PATH=/usr/bin:/bin LD_LIBRARY_PATH=$INCISE_BUILD/lib run -2 --separate-stderr bin/incise train
	[[ "$stderr" == "incise: 'train': its program is not beside incise;"* ]] || complain "$stderr"
}
