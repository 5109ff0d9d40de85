# SPDX-License-Identifier: GPL-2.0-or-later
# Input files of all commands: endless devices, pipes without a writer, limits of size and line.

load cli

setup_file() {
	made_pairs >"$BATS_FILE_TMPDIR/pairs.csv"
	incise train "$BATS_FILE_TMPDIR/pairs.csv" --mf 2,2 -o "$BATS_FILE_TMPDIR/m.fis" 2>/dev/null
	incise compile "$BATS_FILE_TMPDIR/m.fis" -o "$BATS_FILE_TMPDIR/m.fx"
}

setup() {
	work_folder
	cp "$BATS_FILE_TMPDIR"/m.fis* "$BATS_FILE_TMPDIR"/m.fx "$BATS_FILE_TMPDIR"/pairs.csv .
	echo 'tissue = { reaction_N_mm = 0.1; };' >soft.scene
	echo '{}' >r.json
}

# A command that reads FILE; it has 2 GB of addresses and a minute.
incise_in_bounds() {
	timeout -k 1 60 prlimit --as=2000000000 incise "$@"
}

# The last run failed; its last line names this file and holds the text. A warning may precede it.
refused() {
	[ "$status" -eq 1 ] || complain "exit $status: $stderr" || return
	[[ "${stderr_lines[-1]}" == *" $1"*"$2"* ]] || complain "no '$1', '$2' in: $stderr"
}

# Each command line of a file of this kind, with FILE for its name.
readers() {
	cat <<-END
		fis|info FILE
		fis|eval FILE pairs.csv
		fis|compile FILE -o out.fx
		fis|plan soft.scene --model FILE
		fx|info FILE
		fx|eval FILE pairs.csv
		txt|eval m.fis FILE
		scene|plan FILE
		conf|calibrate check -c FILE
		csv|train FILE -o out.fis
		csv|calibrate force --from FILE
		csv|calibrate tip --from FILE
		csv|calibrate stepper --from FILE
		csv|calibrate frame --from FILE
		csv|calibrate depth line --from FILE
		png|calibrate depth two-point --pick 5,5 --from FILE
		json|bench compare r.json FILE
	END
}

@test "an endless device, or a link to one, is refused by name" {
	while IFS='|' read -r suffix command; do
		ln -sf /dev/zero "endless.$suffix"
		# shellcheck disable=SC2086
		run --separate-stderr incise_in_bounds ${command//FILE/endless.$suffix} </dev/null
		refused "endless.$suffix: " "not a regular file" || complain "$command" || return
	done < <(readers)
}

@test "a pipe that nobody writes to is refused by name" {
	while IFS='|' read -r suffix command; do
		[ -p "pipe.$suffix" ] || mkfifo "pipe.$suffix"
		# shellcheck disable=SC2086
		run --separate-stderr incise_in_bounds ${command//FILE/pipe.$suffix} </dev/null
		refused "pipe.$suffix: " || complain "$command" || return
		[[ "$stderr" == *"no program writes to this pipe"* || "$stderr" == *"not a regular file"* ]] ||
			complain "$command: $stderr" || return
	done < <(readers)
}

@test "a file beyond the limit of its kind is refused by name, and not read" {
	while IFS='|' read -r suffix command; do
		truncate -s 40G "large.$suffix"
		# shellcheck disable=SC2086
		run --separate-stderr incise_in_bounds ${command//FILE/large.$suffix} </dev/null
		refused "large.$suffix" || complain "$command" || return
		case $command in
		train* | "eval m.fis "* | *" line "*) [[ "$stderr" == *"a NUL byte"* ]] ;;
		*) [[ "$stderr" == *"larger than "*"iB, the limit of a"* ]] ;;
		esac || complain "$command: $stderr" || return
	done < <(readers)
}

# bats test_tags=check
# bats test_tags=check
@test "a file that may not be read is refused by name" {
	while IFS='|' read -r suffix command; do
		install -m 000 /dev/null "shut.$suffix"
		# shellcheck disable=SC2086
		run --separate-stderr "${plainly[@]}" incise ${command//FILE/shut.$suffix} </dev/null
		refused "shut.$suffix: " "Permission denied" || complain "$command" || return
	done < <(readers)
}

@test "a line without an end is refused by name" {
	head -c 300M /dev/zero | tr '\0' 7 >long
	while IFS='|' read -r suffix command; do
		case $suffix in csv | txt) ;; *) continue ;; esac
		ln -sf long "long.$suffix"
		# shellcheck disable=SC2086
		run --separate-stderr incise_in_bounds ${command//FILE/long.$suffix} </dev/null
		refused "long.$suffix" || complain "$command" || return
		[[ "$stderr" == *"a line longer than 1 MiB"* || "$stderr" == *"larger than "*"iB"* ]] ||
			complain "$command: $stderr" || return
	done < <(readers)
	run --separate-stderr incise_in_bounds eval m.fis <long
	failed_with "standard input:1: a line longer than 1 MiB"
	run --separate-stderr incise_in_bounds train - -o out.fis </dev/zero
	failed_with "standard input:1: a NUL byte"
}

# opened PID FILE: whether that process has it open.
opened() {
	[ -n "$(find "/proc/$1/fd" -lname "$2")" ]
}

# is_drained FD: whether all that was written to that pipe was read.
is_drained() {
	! read -r -t 0 -u "$1"
}

# bats test_tags=check
@test "standard input and pipes with a writer are read" {
	[ "$(incise eval m.fis - <<<'5 20')" = "$(incise eval m.fis <(sleep 0.2; echo '5 20'))" ]
	# a writer that has nothing yet when the pipe is opened
	mkfifo late
	exec 5<>late
	incise eval m.fis late >got 3>&- 5>&- &
	await opened $! "$PWD/late"
	echo '5 20' >&5
	# It looks for a writer, then reads.
	await is_drained 5
	exec 5>&-
	wait $!
	[ "$(cat got)" = "$(incise eval m.fis <<<'5 20')" ]
	incise train <(cat pairs.csv) --group cut --mf 2,2 -o again.fis 2>/dev/null
	cmp <(grep -v ^% m.fis) <(grep -v ^% again.fis)
	[ "$(incise eval <(cat m.fx) <<<'5 20')" = "$(incise eval m.fx <<<'5 20')" ] ||
		incise eval - <<<'5 20' <m.fx || true
	incise info - <m.fis >/dev/null
}

@test "frames that are a pipe or a device are not waited for" {
	printf '%s\n' 'clock = "simulated"; tracker = "sim:"; force = "sim:"; camera = "sim:";' \
		'sim = { depth_mm = [5.0, 5.0]; times = [1, 1]; cut_s = 1.0; };' >rig.conf
	incise capture -o a.rec -r rig.conf 2>/dev/null
	rm a.rec/camera.mkv
	mkfifo a.rec/camera.mkv
	fails timeout -k 1 60 incise verify a.rec -- a.rec "camera.mkv"
}

# bats test_tags=check
@test "a hexadecimal number is none, in files and options" {
	run --separate-stderr incise eval m.fis <<<'0x5 20'
	failed_with "standard input:1: column 1" "'0x5' is not a number"
	printf 'depth_mm,velocity_mm_s,force_N\n0x10,1,1\n' >hex.csv
	fails incise train hex.csv -o out.fis -- "hex.csv:2: column 1 (depth_mm):"
	printf 'mass_g,reading_mV\n0x10,1\n' >hex.csv
	fails incise calibrate force --from hex.csv -- "hex.csv:2: mass_g:" "'0x10'"
	misused incise train pairs.csv --check 0x1p-2 -o out.fis -- "--check:" "'0x1p-2'"
	[ ! -e out.fis ]
}

# bats test_tags=check
@test "a byte order mark of UTF-8 before a text, and comments before a model, are no content" {
	mark=$'\xef\xbb\xbf'
	for file in m.fis pairs.csv soft.scene r.json; do
		{ printf %s "$mark" && cat "$file"; } >"marked-$file"
	done
	[ "$(echo 5 20 | incise eval marked-m.fis)" = "$(echo 5 20 | incise eval m.fis)" ]
	run -0 --separate-stderr incise plan marked-soft.scene
	incise train marked-pairs.csv --mf 2,2 -o n.fis
	printf '%s5 20\n' "$mark" | incise eval m.fis >one
	[ "$(<one)" = "$(echo 5 20 | incise eval m.fis)" ]
	run -1 --separate-stderr incise bench compare marked-r.json r.json
	[[ "$stderr" != *"not JSON"* ]]
	{ echo '# a note' && echo '## another' && cat m.fis; } >hash.fis
	incise plot hash.fis -o hash.svg
	run -1 --separate-stderr incise verify hash.fis
	[[ "$stderr" == *"this is a model"* ]]
}
