# SPDX-License-Identifier: GPL-2.0-or-later
# incise recalibrate: values move, what was recorded does not, and the way back.

load cli

rig=sim:clock=simulated,cut_s=2,pause_s=1
clock=sim:1000,0,20

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	cat >new.conf <<-'END'
		force_mV_N = 1200.0;
		force_zero_mV = 176.5;
		depth_mm_px = 0.12;
		tip_mm = [0.3, -0.2, 1.5];
		tracker_delay_ms = 6.2;
		tracker_delay_sd_ms = 0.3;
	END
	"$INCISE_BUILD/bin/incise" capture -o nominal.rec --rig $rig --duration 8s --clock-source $clock >/dev/null
	"$INCISE_BUILD/bin/incise" capture -o measured.rec --rig $rig --duration 8s --clock-source $clock -c new.conf >/dev/null
}

setup() {
	work_folder
	cp -r "$BATS_FILE_TMPDIR/nominal.rec" a.rec
	cp -r "$BATS_FILE_TMPDIR/measured.rec" b.rec
	cp "$BATS_FILE_TMPDIR/new.conf" new.conf
}

# Rows without the name of the recording.
rows_of() {
	incise export --no-lineage "$1" --resample --rate 200 -o rows.csv --overwrite >/dev/null
	cut -d, -f2- rows.csv
}

# bats test_tags=check
@test "recalibrate gives what a capture by that calibration gives" {
	before=$(sha256sum a.rec/recording.db)
	rows_of a.rec >own
	run -0 --separate-stderr incise recalibrate a.rec -c new.conf
	[ -z "$stderr" ]
	[ "${lines[0]}" = "force_mV_N         1240 -> 1200 mV/N" ]
	[[ "${lines[-1]}" == "wrote a.rec/calibration/0001-"*Z.conf ]]
	[ "$(sha256sum a.rec/recording.db)" = "$before" ]
	cmp new.conf a.rec/calibration/0001-*.conf
	run ! cmp <(rows_of a.rec) own
	# Times are of whole ns, and a recorder rounds its delays to them: one in the last digit may differ.
	paste -d, <(rows_of a.rec) <(rows_of b.rec) | awk -F, '
		NR > 1 { n = NF / 2; for (i = 1; i <= n; i++) {
			dot = index($i, "."); last = dot ? 10 ^ (dot - length($i)) : 1e-9
			if ($i - $(i + n) > 1.1 * last || $(i + n) - $i > 1.1 * last) {
				print "row " NR ", column " i ": " $i " " $(i + n); bad = 1 } } }
		END { exit bad || NR < 1000 }'
	# another one, given for one export, is not mixed with the active one
	sed 's/1200/1300/; /tip/d' new.conf >other.conf
	incise export a.rec -c other.conf --rate 100 -o c.csv >/dev/null
	grep -qx "# calibration: given for the export" c.csv
	grep -qx "# force_mV_N: 1300" c.csv
	# back, to the digit
	run -0 incise recalibrate a.rec --original
	[[ "${lines[-1]}" == "wrote a.rec/calibration/0002-"*Z.original ]]
	cmp <(rows_of a.rec) own
	run -0 incise verify a.rec
	[ "${lines[-1]}" = "a.rec: complete, and as it was written" ]
	fails incise recalibrate a.rec --original -- "a.rec:"
}

@test "values that a calibration does not have stay, and so does a channel's own measured zero" {
	echo "depth_mm_px = 0.13;" >camera.conf
	incise recalibrate a.rec -c camera.conf --json >report.json
	[ "$(key report.json 'changes[0].key')" = depth_mm_px ]
	[ "$(key report.json 'changes[0].now')" = 0.13 ]
	run key report.json 'changes[1].key'
	[ "$status" -ne 0 ]
}

# bats test_tags=check
@test "which calibration is active is said by info, verify, exports and models" {
	sha=$(sha256sum new.conf | cut -d' ' -f1)
	incise recalibrate a.rec -c new.conf >/dev/null
	run -0 incise info a.rec
	[[ "$output" == *"  * calibration/0001-"*"Z.conf, SHA-256 $sha"* ]]
	incise info --json a.rec >info.json
	[ "$(key info.json 'calibrations[0].active')" = 0 ]
	[ "$(key info.json 'calibrations[1].sha256')" = "$sha" ]
	run -0 incise verify a.rec
	[[ "$output" == *"a.rec: read by another calibration than that of the capture: calibration/0001-"* ]]
	incise export a.rec --rate 50 -o a.csv >/dev/null
	grep -q "^# calibration: recalibrated 20.* by calibration/0001-.*, SHA-256 $sha$" a.csv
	incise train a.rec --rate 50 --mf 2,2 -o m.fis 2>/dev/null >&2
	incise info m.fis | grep -q "1200 mV/N.* by calibration/0001-.*SHA-256 $sha"
	# a joined recording takes them along; each member has its own
	incise join a.rec b.rec -o both.rec >/dev/null
	cmp new.conf both.rec/a/calibration/0001-*.conf
	fails incise recalibrate both.rec -c new.conf -- "joined recording" "both.rec/a"
	incise recalibrate both.rec/b -c new.conf >/dev/null
	incise info --json both.rec | grep -q '"file": "b/calibration/0001-'
	incise capture -o a.rec --overwrite --rig $rig --duration 1s >/dev/null
	[ ! -e a.rec/calibration ]
}

# bats test_tags=check
@test "a calibration that is damaged is named, with the way back" {
	echo "force_mV_N = none;" >bad.conf
	fails incise recalibrate a.rec -c bad.conf -- "bad.conf:1: "
	[ ! -e a.rec/calibration ]
	incise recalibrate a.rec -c new.conf >/dev/null
	echo "force_mV_N = 0.0;" >"$(echo a.rec/calibration/*)"
	run --separate-stderr incise export a.rec -o a.csv
	failed_with "a.rec/calibration/0001-" "force_mV_N" 'incise recalibrate a.rec --original'
	incise verify a.rec >/dev/null # what was recorded is not damaged
	incise recalibrate a.rec --original >/dev/null
	incise export --no-lineage a.rec -o a.csv >/dev/null
	# other names are no calibrations
	touch a.rec/calibration/notes.txt a.rec/calibration/9999-today.conf
	incise recalibrate a.rec -c new.conf >/dev/null
	[ -e a.rec/calibration/0003-*.conf ]
}

@test "those that recalibrate at once all get a number, and a link leads nowhere" {
	ids=()
	for i in 1 2 3 4 5 6; do
		echo "force_mV_N = 120$i.0;" >$i.conf
		incise recalibrate a.rec -c $i.conf >/dev/null 3>&- &
		ids+=($!)
	done
	for id in "${ids[@]}"; do
		wait $id
	done
	[ "$(ls a.rec/calibration | cut -c1-4 | paste -sd' ')" = "0001 0002 0003 0004 0005 0006" ]
	mkdir other
	ln -s ../other b.rec/calibration
	fails incise recalibrate b.rec -c new.conf -- "b.rec/calibration: a link"
	[ -z "$(ls other)" ]
}
