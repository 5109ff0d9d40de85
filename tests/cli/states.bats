# SPDX-License-Identifier: GPL-2.0-or-later
# Each command, given a file of each name in each state: missing, unreadable, empty, an archive, binary, a folder, a
# device. One line names the file, and its remedy is of that state, not of another kind of file.

load cli

commands=(info eval verify plot train "train --group none" export replay plan compile provenance merge sign
	recalibrate assess join "haptic --rig sim:" "capture -r" "serve --rig" "calibrate check -c" "calibrate force --from"
	"calibrate tip --from" recover)

setup() {
	work_folder
	chmod 755 "$BATS_TEST_TMPDIR" .
}

# Options without which a command says that they are missing, before it looks at its file.
with_options() {
	case $1 in
	train*) echo "-o new.fis" ;;
	export) echo "-o new.csv" ;;
	compile) [[ $file == *.fis ]] && echo "-o new.fx" || echo "-o new.plan" ;;
	plot) echo "-o new.png" ;;
	merge) echo "-o new.fis" ;;
	sign) echo "--key key" ;;
	recalibrate) echo "--original" ;;
	join) echo "other.rec -o new.rec" ;;
	capture*) echo "-o new.rec --duration 10ms" ;;
	replay) echo "liver" ;;
	recover) echo "-o new.rec" ;;
	esac
}

make_state() { # STATE FILE
	case $1 in
	missing) ;;
	unreadable) cp "$root/scenes/liver.fis" "$2" && chmod 0 "$2" ;;
	empty) : >"$2" ;;
	archive) tar czf "$2" -C "$root" scenes/liver.scene ;;
	binary) head -c 5000 /dev/zero | tr '\0' '\377' >"$2" ;;
	folder) mkdir "$2" ;;
	device) ln -s /dev/null "$2" ;;
	esac
}

# Plainly, and not as another user, who may not see a build folder below /root.
# bats test_tags=check
@test "a file of any name in any state is one line with the remedy for that" {
	cd "$(mktemp -d "$BATS_TEST_TMPDIR/XXXXXX")"
	chmod 777 .
	device=$(stat -c '%A %t:%T' /dev/null)
	wrong='' n=0
	for state in missing unreadable empty archive binary folder device; do
		for file in zz.csv zz.fis zz.conf zz.rec zz.tar; do
			# one name for each state, another in the next, or all with CASES=all
			(((n / 5 + n++) % 5 == 0)) || [ "${CASES:-}" = all ] || continue
			rm -rf zz.*
			make_state $state $file
			for command in "${commands[@]}"; do
				# shellcheck disable=SC2046,SC2086 # words
				run --separate-stderr timeout -k 1 20 "${plainly[@]}" \
					"$INCISE_BUILD/bin/incise" $command $file $(with_options "$command") </dev/null
				what="$state $file: incise $command: exit $status: $stderr"
				[ "$status" = 1 ] || [ "$status" = 2 ] || wrong+="$what"$'\n'
				[[ "${stderr_lines[0]}" == *"$file"* || "$command $output" == "calibrate check -c $file"* ]] || wrong+="not named: $what"$'\n'
				case $stderr in
				*"remove it"*) wrong+="$what"$'\n' ;;
				*"Permission denied; give "*) wrong+="$what"$'\n' ;;
				*[$'\001'-$'\010\016'-$'\037\177\377']*) wrong+="$what"$'\n' ;;
				esac
			done
		done
	done
	[ -z "$wrong" ] || complain "$wrong"
	# which is the machine's, behind a link
	[ "$(stat -c '%A %t:%T' /dev/null)" = "$device" ] || complain "/dev/null was changed: $(stat -c '%A %t:%T' /dev/null)"
}
