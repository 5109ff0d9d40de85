# SPDX-License-Identifier: GPL-2.0-or-later
# The options of all commands: each by itself, and one letter of each in all commands.

load cli

# bats test_tags=check
@test "each option of each command takes what is legal, and refuses what is not by its name" {
	cp "$root/scenes/liver.fis" a.fis
	version=$(sed -n 's/^#define INCISE_VERSION "\(.*\)"/\1/p' "$root/lib/include/incise/version.h")
	run -0 python3 "$root/tests/cli/option_tables.py" "$version" "$INCISE_BUILD"/bin/incise-*
	[ -z "$output" ]
	[ "$(ls -A)" = a.fis ]
}

# bats test_tags=check
@test "old spellings are refused, and the new one is named" {
	while read -r old now command; do
		# shellcheck disable=SC2086 # "calibrate delay" is two words
		run -2 --separate-stderr incise $command $old
		[ "${stderr_lines[0]}" = "incise $command: $old: this option is now ${now/_/ }" ]
	done <<-END
		--time --duration calibrate delay
		--range --max-delay calibrate delay
		--axis --handle calibrate depth
		--pictures --images calibrate depth
		--time --duration calibrate force
		--range --input-range calibrate force
		--time --duration calibrate tip
		--arith --method compile
		--loop --duration demo
		-r --rate export
		--at --poses replay
		--csv -o_FILE.csv replay
		--log -o_FILE.csv replay
		--plot -o_NAME.png replay
		--plot -o_NAME bench
		--log -o_FILE.csv haptic
		--session -o_FILE.session view
		--keep -o_NAME.rec calibrate delay
		--report -o_DIR calibrate depth
		--initial -o_FILE.initial.fis train
		--sd --uncertainty_total eval
		--by-cut --average_NxM,by-cut export
		--zero-u --given-u_zero=VALUE calibrate depth
		--for --duration stepper
		--output-model --output train
		--camera --viewpoint view
	END
	run -2 --separate-stderr incise train pairs.csv --output force_N
	[[ "${stderr_lines[0]}" == *"name the column to learn with --target"* ]]
	run -2 --separate-stderr incise capture --camera pictures
	[[ "${stderr_lines[0]}" == *"auto, off, frames or depth"* ]]
	run -2 --separate-stderr incise info m.fis --plot m
	[ "${stderr_lines[0]}" = "incise info: --plot: this option is now incise plot MODEL.fis -o NAME.png" ]
}
