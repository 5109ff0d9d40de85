# SPDX-License-Identifier: GPL-2.0-or-later
# Training from many sources, factors, and their merge: the same model to the bit.

load cli

# Cuts $2 … $3 of $4 pairs each, 250 by default, into the file $1.
cuts() {
	awk -v from="$2" -v to="$3" -v pairs="${4:-250}" 'BEGIN {
		print "cut,depth_mm,velocity_mm_s,force_N"
		for (c = from; c <= to; c++)
			for (i = 0; i < pairs; i++) {
				d = (i * 7919 + c * 13) % 1000 / 50; v = (i * 104729 + c * 7) % 997 / 20
				noise = (c * 7919 + i * 1299709) % 1000 / 1000 - 0.5
				force = (0.045 * d + 0.0028 * d * d) * (1 + 0.35 * v / (v + 15))
				force = force * (1 + 0.02 * (c % 5 - 2)) + 0.02 * noise
				printf "c%d,%.6f,%.6f,%.6f\n", c, d, v, force
			}
	}' >"$1"
}

shares() {
	for i in 1 2 3 4; do
		cuts "s$i.csv" $((5 * i - 4)) $((5 * i))
	done
}

# Of 80 cuts each: each fifth of them is large enough for a part of a factor.
large_shares() {
	for i in 1 2 3 4; do
		cuts "s$i.csv" $((80 * i - 79)) $((80 * i)) 100
	done
}

@test "train takes many sources in any order" {
	shares
	incise train s1.csv s2.csv s3.csv s4.csv --group cut --check 0.3 -o a.fis >out
	grep -q "4 sources: 3500 pairs to train (14 cuts), 1500 to check (6 cuts)" out
	incise train s3.csv s1.csv s4.csv s2.csv --group cut --check 0.3 -o b.fis >/dev/null
	cmp a.fis b.fis
	cmp a.fis.sd b.fis.sd
	# The notes name what it came from.
	incise info a.fis >out
	for i in 1 2 3 4; do
		grep -q "source: $(sha256sum <s$i.csv | cut -c1-64) [0-9]* pairs, s$i.csv" out
	done
	grep -q -e "options: --group cut --inputs depth_mm,velocity_mm_s --target force_N --check 0.3 --seed 1 --mf 5,4" out
}

@test "a source given twice is named, and a group may be a source" {
	shares
	cp s1.csv same.csv
	fails incise train s1.csv s2.csv same.csv -o m.fis -- same.csv "the same content as s1.csv"
	[ ! -e m.fis ]
	incise train s1.csv s2.csv s3.csv --group recording --check 0.3 -o m.fis >out
	grep -q "(2 groups), 1250 to check (1 group)" out
}

# bats test_tags=check
@test "factors of shares merge to the model of all pairs, to the bit" {
	large_shares
	incise train s1.csv --group cut --mf 3,3 -o start.fis >/dev/null
	incise train s?.csv --premises start.fis --group cut -o all.fis >/dev/null
	incise train s1.csv --premises start.fis --group cut -o a.fac >/dev/null
	incise train s4.csv s3.csv --premises start.fis --group cut -o b.fac >/dev/null
	incise train s2.csv --premises start.fis --group cut -o c.fac >/dev/null
	incise merge c.fac a.fac b.fac -o merged.fis >out
	grep -q "3 factors: 32000 pairs of 320 groups from 4 sources" out
	mean=$(awk -F, 'FNR > 1 { s += $4; q += $4 ^ 2; n++ } END { printf "%.5g", sqrt(q / n - (s / n) ^ 2) }' s?.csv)
	grep -q "^RMSE [0-9.]*, of the mean $mean, R² " out
	grep -q "^RMSE of parts that were held out 0" out
	cmp all.fis merged.fis
	cmp all.fis.sd merged.fis.sd
	incise merge a.fac b.fac -o ab.fac >/dev/null
	incise merge ab.fac c.fac -o - >twice.fis
	cmp all.fis twice.fis
	incise train s?.csv --premises start.fis --group cut -o all.fac >/dev/null
	incise merge ab.fac c.fac -o abc.fac >/dev/null
	cmp all.fac abc.fac
	[ "$(stat -c %s all.fac)" -lt 160000 ]
	incise merge ab.fac c.fac -o j.fis --json >r.json
	[ "$(key r.json pairs)" -eq 32000 ]
}

@test "merge refuses what does not belong together, by name" {
	shares
	incise train s1.csv --mf 3,3 -o start.fis >/dev/null
	incise train s1.csv --premises start.fis --group cut -o a.fac >/dev/null
	fails incise merge a.fac a.fac -o m.fis -- a.fac "the recording s1.csv"
	# another ridge of the premises, another range, another unit
	sed '/MF2/s/\[\([0-9]\)/[1\1/' start.fis >mf.fis
	awk '/^Range/ && !done { sub(/\[.* /, "[-1 "); done = 1 } 1' start.fis >range.fis
	incise train s2.csv --premises mf.fis --group cut -o mf.fac >/dev/null
	incise train s2.csv --premises range.fis --group cut -o range.fac >/dev/null
	sed 's/depth_mm/depth_cm/' s2.csv >cm.csv
	sed 's/depth_mm/depth_cm/' start.fis >cm.fis
	incise train cm.csv --premises cm.fis --group cut -o cm.fac >/dev/null
	for other in "mf.fac:has other membership functions" "range.fac:has other ranges" \
		"cm.fac:has other inputs, or other units"; do
		fails incise merge a.fac "${other%%:*}" -o m.fis -- "${other%%:*}" "${other#*:}"
	done
	head -c 3000 a.fac >cut.fac
	sed 's/^version .*/version 9.9.9/' a.fac >version.fac
	for bad in cut.fac version.fac s1.csv; do
		fails incise merge a.fac $bad -o m.fis -- $bad
	done
	[ ! -e m.fis ]
	# inputs far outside are counted, outputs have no place
	sed '5s/,[^,]*,/,99,/' s3.csv >far.csv
	incise train far.csv --premises start.fis -o far.fac >out
	grep -q "outside the ranges of the model" out
	grep -q "^1 of 5 parts, .*: a merge with it cannot cross-validate; " out
	sed '5s/,[^,]*$/,99/' s3.csv >strong.csv
	run --separate-stderr incise train strong.csv --premises start.fis -o strong.fac
	failed_with strong.csv "force_N = 99"
	[ ! -e strong.fac ]
}

@test "train reads recordings, and names a damaged one" {
	for seed in 1 2 3; do
		incise capture -o $seed.rec \
			--rig "sim:clock=simulated,seed=$seed,depth_mm=6,times=2,pause_s=1,cut_s=2" >/dev/null
	done
	incise train 1.rec 2.rec 3.rec --rate 200 --check 0.3 -o m.fis >out
	grep -q "^3 sources: " out
	incise info m.fis | grep -q "source: $(sha256sum <2.rec/recording.db | cut -c1-64) .* 2.rec, incise:1:recording:.*:2.rec;, recorded .*, rig sim:"
	cp -r 2.rec bad.rec
	sqlite3 bad.rec/recording.db "UPDATE force SET code = code + 1 WHERE rowid = 500"
	run --separate-stderr incise train 1.rec bad.rec 3.rec --rate 200 -o bad.fis
	failed_with bad.rec "not as it was recorded"
	[ ! -e bad.fis ]
}

# bats test_tags=check
@test "info --dataset tells rows, ranges, and the cut that differs" {
	shares
	awk -F, -v OFS=, '$1 == "c7" { $4 = $4 + 2 } 1' s2.csv >odd.csv
	incise info --dataset s1.csv odd.csv s3.csv --group cut >out
	grep -q "^3 sources, 3750 rows, 15 groups by cut$" out
	grep -q "^depth_mm: 0 to 19.98$" out
	[ "$(grep -c "^outlier: " out)" -eq 1 ]
	grep -q "^outlier: group c7 of odd.csv: mean force_N " out
	incise info --dataset s1.csv s3.csv --group recording >out
	grep -q "outliers are sought from 5 groups on" out
}

# Train from l?.csv into m.fis with options, killed when the first line of its progress is like $1, or
# at its end, whichever is first.
train_killed_at() {
	local like=$1
	shift
	incise train l?.csv --group cut --check 0.3 --mf 3,3 -o m.fis "$@" >/dev/null 2>&1 3>&- &
	while kill -0 $! 2>/dev/null; do
		! head -n 1 m.fis.progress 2>/dev/null | grep -qa "$like" || break
		sleep 0.01
	done
	kill -KILL $! 2>/dev/null || :
	wait $! || :
}

@test "a training that was killed goes on, to the same model" {
	for i in 1 2 3; do
		cuts s$i.csv $((20 * i - 19)) $((20 * i))
		awk -F, -v OFS=, 'NR == 1 { print; next } { for (k = 0; k < 8; k++) print $1, $2, $3, $4 + k / 1000 }' \
			s$i.csv >l$i.csv
	done
	incise train l?.csv --group cut --check 0.3 --mf 3,3 -o whole.fis >/dev/null 2>&1
	# killed when the surveys are there, and when a part of the sums is
	for like in 'incise progress 1 [0-9a-f]* [0-9]* 0 ' 'incise progress 1 [0-9a-f]* [0-9]* [1-9]'; do
		train_killed_at "$like"
		if [ ! -e m.fis ]; then
			incise train l?.csv --group cut --check 0.3 --mf 3,3 -o m.fis >out 2>err
			grep -q "goes on from an interrupted training: [1-3] of 3 sources are surveyed" err
		fi
		cmp whole.fis m.fis
		cmp whole.fis.sd m.fis.sd
		[ ! -e m.fis.progress ]
		rm m.fis m.fis.sd
	done
	# of other options it is not used
	train_killed_at incise
	incise train l?.csv --group cut --check 0.3 --seed 2 --mf 3,3 -o m.fis --overwrite >out 2>err
	run ! grep -q "goes on" err
}

@test "sources that change while they are read, or before a training goes on, are found" {
	for i in 1 2; do
		cuts l$i.csv $((20 * i - 19)) $((20 * i)) 2000
	done
	incise train l?.csv --group cut --mf 3,3 -o m.fis >/dev/null 2>err 3>&- &
	until grep -qa "incise progress 1 [0-9a-f]* [1-9]" m.fis.progress 2>/dev/null; do
		kill -0 $! || break
		sleep 0.01
	done
	if kill -STOP $! 2>/dev/null && [ ! -e m.fis ]; then
		sed -i '7s/.$/7/' l1.csv
		kill -CONT $!
		! wait $! || complain "trained"
		grep -q "l1.csv: has changed while it was read" err
	else
		skip "the training ended before it was stopped; unit/learn/corpus changes rows between readings"
	fi
	[ ! -e m.fis.progress ]
}

# Train from $1 and 2.rec into m.fis, killed when it has surveyed one of them.
train_killed_soon() {
	incise train $1 2.rec --rate 200 --mf 2,2 -o m.fis >/dev/null 2>&1 3>&- &
	until [ -e m.fis.progress ]; do
		kill -0 $! || break
		sleep 0.01
	done
	kill -KILL $! 2>/dev/null || :
	wait $! || :
	rm -f m.fis m.fis.sd
}

# A joined recording is read by the calibrations of its members.
@test "a training does not go on with rows of another calibration" {
	local quick=sim:clock=simulated,depth_mm=6,times=2,pause_s=1,cut_s=1
	printf 'force_mV_N = 300.0;\n' >one.conf
	printf 'force_mV_N = 5000.0;\n' >other.conf
	for seed in 1 2; do
		incise capture -o $seed.rec --rig $quick,seed=$seed >/dev/null
	done
	for stream in force tracker; do
		incise capture -o $stream.rec --rig $quick,seed=3 --only $stream --clock-source sim:1000,5,100 >/dev/null
	done
	incise join force.rec tracker.rec -o joined.rec >/dev/null
	incise recalibrate 1.rec -c one.conf >/dev/null
	for change in "incise recalibrate 1.rec -c other.conf" "cp one.conf 1.rec/calibration/0002-*.conf" \
		"incise recalibrate joined.rec/force -c other.conf"; do
		name=1.rec
		[[ "$change" != *joined* ]] || name=joined.rec
		train_killed_soon $name
		eval "$change" >/dev/null
		incise train $name 2.rec --rate 200 --mf 2,2 -o m.fis >/dev/null 2>err
		run ! grep -q "goes on" err
		incise train $name 2.rec --rate 200 --mf 2,2 -o n.fis >/dev/null 2>&1
		cmp m.fis n.fis
		rm m.fis n.fis ./*.sd
	done
}

@test "a recording is the same after its database was written anew" {
	for seed in 1 2; do
		incise capture -o $seed.rec \
			--rig "sim:clock=simulated,seed=$seed,depth_mm=6,times=6,pause_s=0.7,cut_s=0.5" >/dev/null
	done
	cp -r 1.rec copy.rec
	sqlite3 copy.rec/recording.db vacuum
	run ! cmp -s 1.rec/recording.db copy.rec/recording.db
	run --separate-stderr incise train 1.rec copy.rec 2.rec -o m.fis
	failed_with "copy.rec: " "the same content as 1.rec;"
	mkdir -p other/copies
	cp -r 1.rec other/copies/1.rec
	run --separate-stderr incise train 1.rec other/copies/1.rec 2.rec -o m.fis
	failed_with "other/copies/1.rec: " "the same content as 1.rec;"
	rm -r other
	incise train 2.rec --mf 2,2 -o start.fis >/dev/null 2>&1
	for name in 1 copy; do
		incise train $name.rec --premises start.fis -o $name.fac >/dev/null
	done
	fails incise merge 1.fac copy.fac -o m.fis -- copy.fac "the recording copy.rec (SHA-256 "
	[ ! -e m.fis ]
}

@test "a factor goes to a pipe, pipes are told apart by their rows, and options that differ are noted" {
	shares
	incise train s1.csv --mf 3,2 -o start.fis >/dev/null
	incise train s1.csv --premises start.fis --group cut -o a.fac >/dev/null
	incise train s1.csv --premises start.fis --group cut -o fac:- >b.fac
	cmp a.fac b.fac
	incise train s2.csv --premises start.fis --group cut --all-rows -o b.fac --overwrite >/dev/null
	incise merge a.fac b.fac -o m.fis >/dev/null
	incise merge b.fac a.fac -o n.fis >/dev/null
	cmp m.fis n.fis
	grep -q "options: different in the factors" m.fis
	# of the premises, not of the default
	incise train s1.csv --premises start.fis -o m.fis --overwrite --json >r.json 2>/dev/null
	[ "$(key r.json 'mf[0]') $(key r.json 'mf[1]')" = "3 2" ]
	# no penalty was selected among others, and the mean of all cuts is not known
	[ "$(key r.json epochs) $(key r.json crossval_mean_rms_error_N)" = "1 " ]
	incise train s1.csv --premises start.fis -o m.fis --overwrite >text 2>/dev/null
	grep -qE "^  cross-validated: [0-9.]+ N$" text
	[ "$(incise eval m.fis --uncertainty parts <<<'5 20' | cut -d' ' -f6)" = nan ]
	incise eval m.fis --uncertainty parts --json <<<'5 20' >r.json
	[ -z "$(key r.json 'rows[0].sd_mean_N')" ]
	incise train <(cat s1.csv) <(cat s2.csv) -o m.fis --overwrite >/dev/null 2>&1
	run --separate-stderr incise train <(cat s1.csv) <(cat s1.csv) -o m.fis --overwrite
	failed_with "the same content"
}

@test "a file that has the name of the progress, and is none, stays" {
	shares
	cp s1.csv m.fis.progress
	incise train m.fis.progress s2.csv -o m.fis >/dev/null
	cmp s1.csv m.fis.progress
}

@test "a factor whose first line reaches into its checksum is refused" {
	printf 'incise factor %0224d1\n\223a/' 0 >bad.fac
	fails incise info bad.fac -- bad.fac damaged
}
