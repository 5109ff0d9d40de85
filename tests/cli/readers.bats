# SPDX-License-Identifier: GPL-2.0-or-later
# Who reads a recording leaves all as it was: nothing is written, made or removed where it is, whatever is
# in it; and incise recover, which makes a whole one of an interrupted one.

load cli

setup_file() {
	cd "$BATS_FILE_TMPDIR"
	PATH=$INCISE_BUILD/bin:$PATH
	incise capture -o closed.rec --rig sim:seed=3,clock=simulated,cut_s=1,pause_s=0.5 --duration 9s >/dev/null
	# a recorder that is killed leaves its log
	incise capture -o killed.rec --rig sim:clock=real --duration 1h >/dev/null 2>&1 3>&- &
	# behind the zero of the force, which takes 0.5 s
	has_rows() {
		[ "$(incise info killed.rec --json | jq .rows.force)" -gt 9000 ]
	}
	await has_rows
	kill -KILL $!
	wait $! || true
	mv killed.rec.part killed.rec
	# its index is not there on a medium that cannot be written
	cp -r killed.rec bare.rec
	rm -f bare.rec/recording.db-shm
	python3 "$BATS_TEST_DIRNAME/hot_journal.py" closed.rec journal.rec
	python3 "$BATS_TEST_DIRNAME/hot_journal.py" closed.rec hostile.rec "$PWD/victim"
	echo precious >victim
}

setup() {
	work_folder
	cp -r "$BATS_FILE_TMPDIR"/*.rec .
	cp "$root/scenes/liver.fis" m.fis
	mkdir out tmp
	export TMPDIR=$PWD/tmp
}

# Names, kinds, sizes, times and contents.
state() {
	find "$BATS_FILE_TMPDIR/victim" ./*.rec -printf '%p %y %s %m %T@ %C@ %l\n' | sort
	find "$BATS_FILE_TMPDIR/victim" ./*.rec -type f -exec sha256sum {} + | sort
}

# bats test_tags=check
@test "no command that reads a recording changes it, or what it names" {
	local n=0
	state >before
	while read -r command; do
		for of in closed killed bare journal hostile; do
			# each half of the whole ones, or all with CASES=all
			[[ "$of" == killed || "$of" == hostile ]] || ((n++ % 2 == 0)) || [ "${CASES:-}" = all ] || continue
			incise ${command//REC/$of.rec} >out/stdout 2>out/stderr || [ $? = 1 ] ||
				complain "${command//REC/$of.rec}: $(cat out/stderr)"
			[ $of != hostile ] || grep -q "hostile.rec: its recording.db-journal names another file" out/stderr ||
				complain "$command: $(cat out/stderr)"
			rm -rf out/*
			[ -z "$(ls tmp)" ] || complain "$command: left $(ls tmp)"
		done
		state | cmp -s before - || complain "$command: $(state | diff before -)"
	done <<-END
		info REC
		verify REC
		verify REC --json
		export REC -o out/a.csv
		export REC --resample --rate 100 -o out/a.mcap
		plot REC -o out/a.svg
		replay REC wall
		train REC --premises m.fis -o out/m.fis
		join REC closed.rec -o out/j.rec
		info --dataset REC
		recover REC -o out/r.rec
	END
}

# bats test_tags=check
@test "an interrupted recording is recovered: what was committed, and all files" {
	mkdir killed.rec/calibration
	echo "force_mV_N = 1200.0;" >killed.rec/calibration/0001-20261127T054012Z.conf
	incise verify killed.rec >before || [ $? = 1 ]
	incise recover killed.rec -o new.rec >out/said
	[[ "$(cat out/said)" == "killed.rec: "*" force samples, "*" tracker samples, "* ]]
	grep -q "^new.rec: .*'incise verify' still says 'interrupted'" out/said
	[ "$(cd new.rec && find . -type f | sort)" = "./calibration/0001-20261127T054012Z.conf"$'\n'./recording.db ]
	cmp {killed,new}.rec/calibration/0001-20261127T054012Z.conf
	incise verify new.rec >after || [ $? = 1 ]
	cmp <(sed 's/killed/new/' before) after
	incise verify --json new.rec >report || [ $? = 1 ]
	[ "$(key report intact)" = 1 ]
	# the same rows, but for the name
	for of in killed new; do
		incise export $of.rec --resample | grep -v '^#' | cut -d, -f2- >out/$of.csv
	done
	[ "$(wc -l <out/new.csv)" -gt 3000 ]
	cmp out/{killed,new}.csv
	fails incise recover killed.rec -o new.rec -- new.rec "exists"
	incise recover journal.rec -o new.rec --overwrite >out/said
	! grep interrupted out/said
	incise verify new.rec >/dev/null
	fails incise recover hostile.rec -o no.rec -- hostile.rec "names another file"
	[ ! -e no.rec ] && [ ! -e no.rec.part ]
}

@test "a recording that is too large for a copy is refused with the command that recovers it" {
	truncate -s 1025M killed.rec/recording.db-wal
	state >before
	fails incise info killed.rec -- killed.rec "incise recover killed.rec -o NEW.rec"
	state | cmp before -
}

@test "an interrupted recording on a medium that cannot be written is read" {
	for of in killed bare journal; do
		chmod -R a-w $of.rec
		"${plainly[@]}" incise info $of.rec >out/said || complain "$of"
		grep -q "^force " out/said
		chmod -R u+w $of.rec
	done
}
