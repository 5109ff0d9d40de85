# SPDX-License-Identifier: GPL-2.0-or-later
# incise recover of recordings of older forms, those of tests/forms: it makes one of today's, which says the
# same in all that is read of it. Of interrupted ones see readers.bats.

load cli

setup() {
	work_folder
	mkdir old new
	for form in 1 2 3 4; do
		old_form old/$form.rec $form
	done
}

# rows FOLDER FORM: the samples and tables, in FOLDER/FORM.*
rows() {
	(
		cd "$1"
		"$INCISE_BUILD/tests/sql" $2.rec/recording.db "SELECT seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy,
			qz, status FROM tracker; SELECT * FROM force" >$2.rows
		[ $2 -lt 3 ] || "$INCISE_BUILD/tests/sql" $2.rec/recording.db "SELECT * FROM wall" >>$2.rows
		sqlite3 $2.rec/recording.db "SELECT * FROM events ORDER BY rowid; SELECT * FROM meta WHERE key NOT IN
			('converted_from', 'cuts', 'depth_max_mm', 'force_max_N', 'identity') ORDER BY key" >$2.tables
	)
}

# exports FOLDER FORM: what is read of it, in FOLDER/FORM.*; its name is that of form 4
exports() {
	(
		cd "$1"
		incise export --no-lineage $2.rec -o $2.csv
		incise export --no-lineage $2.rec -o $2.u.csv --uncertainty parts 2>/dev/null
		incise export --no-lineage $2.rec -o $2.r.csv --resample --rate 50
		sed -i "s/^$2\([-,]\)/4\1/" $2.csv $2.u.csv $2.r.csv
		incise export $2.rec -o $2.mcap
		chunks $2.mcap >$2.chunks
		incise info $2.rec | sed "s/\<$2\.rec/4.rec/; /^seal  \|^samples  \|^wall time  \|^ *by .*, time of /d" >$2.info
		incise info --json $2.rec | jq 'del(.seal, .seals, .summary, .wall)' >$2.json
	) >/dev/null
}

# Chunks of MCAP, whose messages are the samples: without what the file says of its origin.
chunks() {
	python3 - "$1" <<-'END'
		import struct, sys
		data = open(sys.argv[1], "rb").read()
		at = 8
		while at < len(data) - 8:
		    kind, size = data[at], struct.unpack_from("<Q", data, at + 1)[0]
		    if kind in (3, 4, 5, 6):
		        print(kind, data[at + 9:at + 9 + size].hex())
		    at += 9 + size
	END
}

# bats test_tags=check
@test "recordings of forms 1 to 4 become one of form 5 that gives the same" {
	for form in 1 2 3 4; do
		before=$(sha256sum old/$form.rec/*)
		run -0 --separate-stderr incise recover old/$form.rec -o new/$form.rec
		[ "${lines[0]}" = "old/$form.rec: 180 force samples, 54 tracker samples, 1.8 s" ]
		[[ "${lines[1]}" == "old/$form.rec: converted from format $form"* ]]
		[ "${lines[2]}" = "wrote new/$form.rec" ]
		[ "$(sha256sum old/$form.rec/*)" = "$before" ]
		[ "$(ls new/$form.rec)" = recording.db ]
		[ "$(sqlite3 new/$form.rec/recording.db "PRAGMA user_version")" = 5 ]
		run -0 --separate-stderr incise verify new/$form.rec
		[[ "$output" == *"new/$form.rec: complete, and as it was written" ]]
		[[ "$output" == *" commits, chained"* ]]
		rows old $form
		rows new $form
		for kind in rows tables; do
			diff old/$form.$kind new/$form.$kind
		done
		for table in streams knots; do
			[ $form = 1 ] || cmp <(sqlite3 old/$form.rec/recording.db "SELECT * FROM $table") \
				<(sqlite3 new/$form.rec/recording.db "SELECT * FROM $table")
		done
	done
	# form 1 knew no station
	[ "$("$INCISE_BUILD/tests/sql" new/1.rec/recording.db "SELECT DISTINCT station, button FROM tracker")" = "0|0" ]
	# forms 2 to 4 are of one capture, and 4 is read as it is
	exports old 4
	[ "$(wc -l <old/4.chunks)" -gt 3 ]
	for form in 2 3 4; do
		exports new $form
		for kind in csv u.csv r.csv chunks info json; do
			diff old/4.$kind new/$form.$kind
		done
	done
	from() { sqlite3 new/$1.rec/recording.db "SELECT value FROM meta WHERE key = 'converted_from'"; }
	[[ "$(incise recover old/1.rec -o new/again.rec)" == *"has no ledger: its rows could not be checked"* ]]
	[ "$(from 1)" = "format 1" ]
	[[ "$(from 3)" == "format 3, ledger force e09369c4, table:depth 6202938c, "*", wall d5"* ]]
	[ "$(from 4)" = "format 4, head 13547397f629411a96ca057db292646ea5a6dba42a7262d0530a839653844c9d" ]
	# blocks and commits of form 4 are those of before
	for sql in "SELECT number, t_ns, force, tracker, camera, wall FROM seal" \
		"SELECT value FROM meta WHERE key = 'identity'"; do
		[ "$(sqlite3 new/4.rec/recording.db "$sql")" = "$(sqlite3 old/4.rec/recording.db "$sql")" ]
	done
	fields="stream, block, first_seq, last_seq, first_ns, last_ns, count, lost"
	for form in 2 3 4; do
		[ "$(sqlite3 new/$form.rec/recording.db "SELECT $fields FROM blocks ORDER BY stream, block")" = \
			"$(sqlite3 old/$form.rec/recording.db \
				"SELECT $fields FROM ledger WHERE stream NOT LIKE '%:%' ORDER BY stream, block")" ]
	done
}

@test "signatures of before are kept beside the new one, and do not count as its own" {
	ssh-keygen -q -t ed25519 -N "" -C kim@lab -f kim
	echo "kim@lab $(cat kim.pub)" >signers
	incise sign old/4.rec --key kim >/dev/null
	mkdir old/4.rec/calibration
	echo "force_mV_N = 1200.0;" >old/4.rec/calibration/0001-20261127T054012Z.conf
	run -0 --separate-stderr incise recover old/4.rec -o new/4.rec
	[ "${lines[2]}" = "1 signature and 0 time-stamps of format 4 are kept in new/4.rec/seal-before, not of the new one" ]
	[ ! -e new/4.rec/seal ]
	diff -r old/4.rec/seal new/4.rec/seal-before
	diff -r {old,new}/4.rec/calibration
	run --separate-stderr incise verify new/4.rec --signers signers
	failed_with new/4.rec "not signed" "seal-before/ has signatures of it before its conversion"
	# who puts them back is told what they are
	cp -r new/4.rec/seal-before new/4.rec/seal
	run -1 --separate-stderr incise verify new/4.rec --signers signers
	[[ "$output" == *"the statement is of this recording before its conversion from an older format"* ]]
	[[ "$output" != *"altered"* ]]
	# and it can be signed anew, recovered and replaced
	rm -r new/4.rec/seal
	incise sign new/4.rec --key kim >/dev/null
	incise verify new/4.rec --signers signers >/dev/null
	incise recover new/4.rec -o new/again.rec >/dev/null
	diff -r new/4.rec new/again.rec
	incise recover old/4.rec -o new/4.rec --overwrite >/dev/null
	[ ! -e new/4.rec/seal ] && [ -e new/4.rec/seal-before ]
}

@test "what was made of a recording before its conversion finds it" {
	incise export old/4.rec -o old/a.csv >/dev/null
	mv old/4.rec before.rec
	incise recover before.rec -o old/4.rec >/dev/null
	run -0 --separate-stderr incise provenance old/a.csv
	[[ "${lines[1]}" == *": "*"4.rec was converted since, and had this head" ]]
	# that is said of its samples as they are
	"$INCISE_BUILD/tests/sql" old/4.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 90"
	run -1 --separate-stderr incise provenance old/a.csv
	[[ "${lines[1]}" == *"not as it was recorded"* ]]
}
