# SPDX-License-Identifier: GPL-2.0-or-later
# incise verify, as a user meets it: what is whole is proved, and of every tampering it is
# said what and where. One of each kind: tests/unit/record/verify.c has all of them.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	"$INCISE_BUILD/bin/incise" capture -o good.rec --rig sim:clock=simulated \
		--duration 3s >/dev/null
}

setup() {
	work_folder
	cp -r "$BATS_FILE_TMPDIR/good.rec" a.rec
}

# tampered SQL TEXT…: after that, verify fails, with lines that hold these texts.
tampered() {
	local sql=$1
	shift
	rm -rf a.rec
	cp -r "$BATS_FILE_TMPDIR/good.rec" a.rec
	ask a.rec "$sql"
	fails incise verify a.rec -- "a.rec:"
	for text; do
		[[ "$output" == *"$text"* ]] || complain "$sql: no '$text' in: $output"
	done
}

# bats test_tags=check
@test "verify of a whole recording says so" {
	before=$(sha256sum a.rec/recording.db)
	run -0 --separate-stderr incise verify a.rec
	[ -z "$stderr" ]
	[ "${lines[0]}" = "force    30000 expected, 30000 present, 0 lost, in 31 blocks" ]
	[[ "${lines[1]}" == "tracker  "*" expected, "*" present, 0 lost, in 31 blocks" ]]
	[ "${lines[2]}" = "seal     33 commits, chained" ]
	[ "${lines[3]}" = "a.rec: complete, and as it was written" ]
	[ "${#lines[@]}" -eq 4 ]
	[ "$(sha256sum a.rec/recording.db)" = "$before" ]
	[ "$(ls a.rec)" = recording.db ]
}

# bats test_tags=check
@test "verify --json has what scripts lean on" {
	incise verify a.rec --json >report.json
	[ "$(key report.json complete)" = 1 ]
	[ "$(key report.json intact)" = 1 ]
	[ "$(key report.json 'streams[0].name')" = force ]
	[ "$(key report.json 'streams[0].expected')" = 30000 ]
	[ "$(key report.json 'streams[0].present')" = 30000 ]
	[ "$(key report.json 'streams[0].lost')" = 0 ]
	[ "$(key report.json 'streams[1].name')" = tracker ]
	[ "$(key report.json findings)" = "[]" ]
	[ "$(key report.json unverified)" = 0 ]
	[ -z "$(key report.json pictures)" ]

	ask a.rec "DELETE FROM force WHERE seq BETWEEN 100 AND 104"
	run -1 --separate-stderr incise verify a.rec --json
	echo "$output" >report.json
	[ "$(key report.json complete)" = 0 ]
	[ "$(key report.json 'streams[0].present')" = 29995 ]
	[ "$(key report.json 'streams[0].lost')" = 5 ]
	[ "$(key report.json 'findings[0].kind')" = lost ]
	[ "$(key report.json 'findings[0].first_seq')" = 100 ]
	[ "$(key report.json 'findings[0].last_seq')" = 104 ]
	[ "$(key report.json 'findings[0].first_ns')" = "$(ask a.rec \
		'SELECT t_ns FROM force WHERE seq = 99')" ]
	[ "$(key report.json 'findings[1].kind')" = altered ]
	[ "$(key report.json 'findings[1].first_block')" = 0 ]
}

# bats test_tags=check
@test "verify says what is not as it was written: rows, the ledger, tables without blocks" {
	tampered "DELETE FROM force WHERE seq = 12345" \
		"a.rec: force: 1 missing, number 12345, before 1.2346 s" "force: block 12 is altered"
	tampered "INSERT INTO force SELECT 30000, t_ns + 100000, code FROM force
		WHERE seq = 29999" "force: block 29 is altered" "30000 rows were written, and the ledger has 30001"
	tampered "DELETE FROM blocks WHERE stream = 'force' AND block = 12" "force: block 12 is missing"
	tampered "DELETE FROM blocks WHERE stream = 'force' AND block >= 29" \
		"the ledger has no end: its last blocks were removed" "1000 lost"
	tampered "DELETE FROM blocks" "has no end"
	tampered "DELETE FROM ledger" "table meta"
	tampered "UPDATE meta SET value = 100.0 WHERE key = 'force_mV_N'" \
		"a.rec: table meta is altered: its rows or its seal differ from those written"
}

@test "verify holds the pictures of the camera against their rows" {
	[ -e "$INCISE_BUILD/lib/incise/frames_mkv.so" ] || skip "frames_mkv.so is not built"
	incise capture -o c.rec --rig sim:clock=simulated --camera frames --duration 300ms
	n=$(ask c.rec "SELECT count(*) FROM frames")
	run -0 --separate-stderr incise verify c.rec
	[[ "${lines[2]}" == "camera   $n expected, $n present, 0 lost, in "*" blocks" ]]
	[ "${lines[3]}" = "         $n frames as written, 0 missing, 0 altered, 0 without a row" ]
	incise verify c.rec --json >report.json
	[ "$(key report.json pictures.checked)" = 1 ]
	[ "$(key report.json pictures.present)" = "$n" ]

	# a byte in the middle of the file is some picture's
	cp -r c.rec d.rec
	size=$(stat -c %s d.rec/camera.mkv)
	byte=$(od -An -tu1 -j $((size / 2)) -N 1 d.rec/camera.mkv)
	printf '%b' "\\0$(printf %o $((byte ^ 1)))" |
		dd of=d.rec/camera.mkv bs=1 seek=$((size / 2)) conv=notrunc 2>/dev/null
	fails incise verify d.rec -- "d.rec:"
	[[ "$output" == *"d.rec: camera: 1 altered in camera.mkv, number "*": its bytes are not as written"* ]] ||
		complain "$output"

	truncate -s $((size / 2)) d.rec/camera.mkv
	fails incise verify d.rec -- "d.rec:"
	[[ "$output" == *" missing in camera.mkv, numbers "* ]]

	# its length is known: nothing behind its end, nothing less
	for change in "printf x" "head -c 5000000 /dev/zero" "cat c.rec/camera.mkv"; do
		cp c.rec/camera.mkv d.rec/camera.mkv
		$change >>d.rec/camera.mkv
		fails incise verify d.rec -- "d.rec:"
		[[ "$output" == *"d.rec: camera.mkv has $(stat -c %s d.rec/camera.mkv) bytes of $size"* ]] ||
			complain "$change: $output"
	done
	cp c.rec/camera.mkv d.rec/camera.mkv
	truncate -s -1 d.rec/camera.mkv
	fails incise verify d.rec -- "d.rec:"
	[[ "$output" == *"d.rec: camera.mkv has $((size - 1)) bytes of $size"* ]]

	rm d.rec/camera.mkv
	fails incise verify d.rec -- "d.rec:"
	[[ "$output" == *"camera.mkv is missing, and $n frames with it"* ]]
}

@test "verify takes nothing behind the last page of the database" {
	for n in 1 4096 1000000; do
		cp -r "$BATS_FILE_TMPDIR/good.rec" b.rec
		head -c $n /dev/zero >>b.rec/recording.db
		run --separate-stderr incise verify b.rec
		[ "$status" -eq 1 ] || complain "$n bytes: $output"
		[[ "$output$stderr" == *"recording.db"* ]]
		rm -r b.rec
	done
}

@test "verify of a page that went bad" {
	dd if=/dev/urandom of=a.rec/recording.db bs=4096 seek=20 count=1 conv=notrunc 2>/dev/null
	fails incise verify a.rec -- "a.rec:"
	[[ "$output" == *"recording.db is damaged"* ]]
}

# bats test_tags=check
@test "a recording of a form that is not known yet is told from a damaged one" {
	ask a.rec "PRAGMA user_version=6"
	for verb in verify info export; do
		fails incise $verb a.rec -- "a.rec:"
	done
}

# bats test_tags=check
@test "verify of nothing" {
	fails incise verify none.rec -- "none.rec:"
}
