# SPDX-License-Identifier: GPL-2.0-or-later
# The way back from a figure, a model or an export to its recordings.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	"$INCISE_BUILD/bin/incise" capture -o "a b;.rec" --rig sim:clock=simulated,depth_mm=6,times=5,pause_s=0.5,cut_s=2 >/dev/null
	"$INCISE_BUILD/bin/incise" export "a b;.rec" --average 6x6,by-cut,count=5 -o p.csv >/dev/null
	"$INCISE_BUILD/bin/incise" train p.csv --mf 2,2 -o m.fis >/dev/null 2>&1
}

setup() {
	work_folder
	made=$BATS_FILE_TMPDIR
	cp -r "$made/a b;.rec" "$made/p.csv" "$made/m.fis" "$made/m.fis.sd" .
	head=$(sqlite3 "a b;.rec/recording.db" "SELECT lower(hex(head)) FROM seal ORDER BY number DESC LIMIT 1")
	found="recording a b;.rec, commit $(sqlite3 "a b;.rec/recording.db" "SELECT max(number) FROM seal"), head ${head:0:16}…"
}

# bats test_tags=check
@test "a figure leads over model and export back to the recording, in each of its forms" {
	command -v gnuplot || skip "gnuplot is not installed"
	for form in png svg pdf; do
		incise plot m.fis -o f.$form
		run -0 --separate-stderr incise provenance f.$form
		[ "${lines[0]}" = "f.$form was made of" ]
		[[ "${lines[1]}" == "  model m.fis, SHA-256 "*"…: m.fis is this file" ]]
		[[ "${lines[2]}" == "    table p.csv, SHA-256 "*"…: p.csv is this file" ]]
		[ "${lines[3]}" = "      $found: a b;.rec has this head" ]
		[ "${#lines[@]}" = 4 ]
	done
	# each is still a figure of its kind
	python3 - <<-'END'
		import struct, xml.dom.minidom, zlib
		data, at = open("f.png", "rb").read(), 8
		while at < len(data):
		    n, = struct.unpack(">I", data[at:at + 4])
		    crc, = struct.unpack(">I", data[at + 8 + n:at + 12 + n])
		    assert crc == zlib.crc32(data[at + 4:at + 8 + n])
		    at += 12 + n
		xml.dom.minidom.parse("f.svg")
		pdf = open("f.pdf", "rb").read()
		start = int(pdf.split(b"startxref")[-1].split()[0])
		assert pdf[-1024:].rstrip().endswith(b"%%EOF")
		assert pdf[start:start + 4] == b"xref" or b"/XRef" in pdf[start:start + 300]
	END
	incise plot "a b;.rec" -o r.svg
	run -0 --separate-stderr incise provenance r.svg --json
	jq -e --arg head "$head" '.origins | length == 1 and .[0].sha256 == $head and .[0].state == "same"' <<<"$output"
}

@test "a model keeps the options that make it again" {
	incise train p.csv --group cut --check 0.3 --mf 3,2 --seed 7 --ridge 1 --all-rows -o a.fis >/dev/null 2>&1
	run -0 --separate-stderr incise provenance a.fis
	options="--group cut --all-rows --inputs depth_mm,velocity_mm_s --target force_N --check 0.3 --seed 7 --mf 3,2 --ridge 1"
	[ "${lines[0]}" = "a.fis was made by incise train … $options of" ]
	# shellcheck disable=SC2086 # the options are words
	incise train p.csv $options -o b.fis >/dev/null 2>&1
	cmp a.fis b.fis
	incise train p.csv --inputs velocity_mm_s,depth_mm --search type=gbellmf,classic,step=0.1 --epochs 2 \
		--mf 2,2 -o c.fis >/dev/null 2>&1
	command="incise train … --group cut --inputs velocity_mm_s,depth_mm --target force_N --mf 2,2 --search type=gbellmf"
	command+=" --search classic,step=0.1 --epochs 2"
	[ "$(incise provenance c.fis --json | jq -r .command)" = "$command" ]
	${command/…/p.csv} -o d.fis >/dev/null 2>&1
	cmp c.fis d.fis
	incise train "a b;.rec" --rate 100 --cut 2 --mf 2,2 -o r.fis >/dev/null 2>&1
	grep -q "^% incise: source: .*, read with --rate 100 --cut 2$" r.fis
}

@test "exports carry it: CSV, HDF5, MCAP; and models of recordings, also merged ones" {
	incise export "a b;.rec" --rate 100 -o e.csv
	incise export "a b;.rec" -o e.mcap
	files="e.csv e.mcap"
	if [ -e "$INCISE_BUILD/lib/incise/export_hdf5.so" ]; then
		incise export "a b;.rec" -o e.h5
		files+=" e.h5"
	fi
	incise train "a b;.rec" --rate 1000 --mf 2,2 -o r.fis >/dev/null 2>&1
	incise train "a b;.rec" --rate 1000 --premises r.fis -o r.fac >/dev/null 2>&1
	incise merge r.fac -o merged.fis >/dev/null
	for file in $files r.fis merged.fis; do
		run -0 --separate-stderr incise provenance $file
		[ "${lines[1]}" = "  $found: a b;.rec has this head" ] || complain "$file: $output"
	done
	run -0 incise info --dataset e.csv
	[[ "$output" != *incise:* ]]
	[[ "$output" == *" groups  e.csv"* ]]
}

# bats test_tags=check
@test "what differs, is missing or says nothing is named" {
	mkdir away
	cp m.fis away
	run -0 --separate-stderr incise provenance away/m.fis
	[ "${lines[2]}" = "    $found: not here" ]
	run -0 --separate-stderr incise provenance away/m.fis --recording "a b;.rec"
	[ "${lines[2]}" = "    $found: a b;.rec has this head" ]
	echo "# changed" >>p.csv
	fails incise provenance m.fis -- "m.fis:"
	[[ "${lines[1]}" == *": p.csv is another file, or was changed" ]]
	rm p.csv
	sqlite3 "a b;.rec/recording.db" "UPDATE seal SET head = zeroblob(32)"
	run -1 --separate-stderr incise provenance m.fis
	[[ "${lines[2]}" == *": a b;.rec is another recording, or was changed" ]]
	# a pipe of that name is not waited for
	rm -r "a b;.rec"
	mkfifo p.csv "a b;.rec"
	run -0 --separate-stderr timeout 60 incise provenance m.fis

	fails incise provenance away -- "away:"
	incise export "$made/a b;.rec" --average 6x6,count=5 --no-lineage -o plain.csv >/dev/null
	fails incise provenance plain.csv -- "plain.csv:"
	sed '/^% incise/d' "$made/m.fis" >table.fis
	fails incise provenance table.fis -- "table.fis:" "incise.train() of a table"
	fails incise provenance m.fis.sd -- "m.fis.sd:"
	fails incise provenance none -- "none:"
	incise haptic neck --procedure --duration 1s -o s.session >/dev/null
	fails incise provenance s.session -- s.session "keys source and scene"
	a=$(printf 'a%.0s' {1..64})
	printf 'x\0incise:1:model:%s:0:-:%%1B%%5B31m%%2E.fis;incise:1:model:%s:0:-:%%1B%%5B31m.fis;' "$a" "$a" >odd
	run -1 --separate-stderr incise provenance odd
	[[ "${lines[1]}" == "  model ?[31m.fis, SHA-256 aaaaaaaaaaaaaaaa…: not here" ]]
	[[ "$stderr" == *"odd: its way back ends before a recording"* ]]
}

# bats test_tags=check
@test "a head that is the same does not hide rows that were changed, nor another calibration" {
	cp -r "a b;.rec" here.rec
	incise export here.rec -o then.csv >/dev/null
	run -0 incise provenance then.csv
	echo 'force_mV_N = 1111.0;' >c.conf
	incise recalibrate here.rec -c c.conf >/dev/null
	run -1 --separate-stderr incise provenance then.csv
	[[ "$output" == *"here.rec: is read by another calibration now"* ]]
	incise export here.rec -o now.csv >/dev/null
	run -0 incise provenance now.csv
	[[ "$output" == *"calibration 0001-"*".conf is this file"* ]]
	incise recalibrate here.rec --original >/dev/null
	run -1 --separate-stderr incise provenance now.csv --json
	[ "$(jq -r '.origins[] | .state' <<<"$output" | paste -sd' ')" = "other same" ]
	run -0 incise provenance then.csv
	# one that was given for the export
	incise export here.rec -c c.conf -o given.csv >/dev/null
	run -0 incise provenance given.csv
	[[ "$output" == *"calibration c.conf, SHA-256 "*": c.conf is this file"* ]]
	echo 'force_mV_N = 1112.0;' >c.conf
	run -1 --separate-stderr incise provenance given.csv --json
	[ "$(jq -r '.origins[] | .state' <<<"$output" | paste -sd' ')" = "same other" ]
	sqlite3 here.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 5"
	run -1 --separate-stderr incise provenance then.csv
	[[ "$output" == *"here.rec: not as it was recorded: force: block 0 is altered"* ]]
}
