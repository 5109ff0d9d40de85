# SPDX-License-Identifier: GPL-2.0-or-later
# Recordings of each form that there was, as the versions of their time wrote them (6d1dcf0a,
# 2c8c1c32, 963d420e, 9da18e94, f8772be0): tests/forms/FORM.sql are their databases, by `.dump`, with the rows
# that forms have alike in A-B.sql, of
#
#   incise capture -o FORM.rec --duration 1800ms --rig \
#       sim:clock=simulated,seed=1,force_hz=100,tracker_hz=30,cut_s=0.5,pause_s=0.3 \
#       --clock-source sim:1800000000 (from form 3 on)
#
# They are converted for ever, and form 4 is read as it is. A new form gets a file of its own here, and the files of
# others are never made anew.

load cli

setup() {
	work_folder
	for form in 1 2 3 4 5; do
		old_form $form.rec $form
	done
}

@test "the newest form has its file here" {
	incise capture -o new.rec --rig sim:clock=simulated --duration 100ms >/dev/null 2>&1
	form=$(sqlite3 new.rec/recording.db "PRAGMA user_version")
	[ -e "$root/tests/forms/$form.sql" ]
	[ ! -e "$root/tests/forms/$((form + 1)).sql" ]
}

# sums FILE: of the rows of a CSV
sums() { awk -F, 'NR > 1 { n++; f += $5; d += $3 } END { printf "%d %.3f %.2f", n, f, d }' "$1"; }

# bats test_tags=check
@test "forms 1 to 3 are refused with the command that converts them, by all commands" {
	commands=("info" "info --json" "verify" "verify --signers signers" "export -o a.csv" "export -o a.mcap" \
		"export -o a.csv --resample --rate 50" "train -o a.fis" "plot -o a.png" "sign --key key" "recalibrate -c c.conf" \
		"calibrate delay --from" "join 5.rec -o j.rec")
	touch signers
	ssh-keygen -q -t ed25519 -N "" -f key
	echo "force_mV_N = 1200.0;" >c.conf
	for form in 1 2 3; do
		for command in "${commands[@]}"; do
			run --separate-stderr incise $command $form.rec
			failed_with "has format $form of an older incise; \`incise recover $form.rec -o NEW.rec\`"
		done
	done
	run --separate-stderr incise replay 1.rec "$root/scenes/liver.scene"
	failed_with "\`incise recover 1.rec -o NEW.rec\`"
	# of a joined recording they are those of a member
	incise join 4.rec 5.rec -o j.rec >/dev/null
	rm -r j.rec/4 && cp -r 3.rec j.rec/4
	fails incise info j.rec -- "j.rec/4: has format 3" "\`incise recover j.rec/4 -o NEW.rec\`"
}

# bats test_tags=check
@test "recordings of forms 4 and 5, and those converted of older ones, are read, verified and exported" {
	for form in 1 2 3; do
		incise recover $form.rec -o new.rec >/dev/null
		rm -r $form.rec
		mv new.rec $form.rec
	done
	for form in 1 2 3 4 5; do
		run -0 --separate-stderr incise verify $form.rec
		[[ "$output" == "force    180 expected, 180 present, 0 lost, in "* ]]
		[[ "$output" == *"$form.rec: complete, and as it was written" ]]
		[[ "$output" == *"seal     "*" commits, chained"* ]]
		incise info --json $form.rec >info.json
		[ "$(key info.json rows.force) $(key info.json rows.tracker)" = "180 54" ]
		incise export --no-lineage $form.rec -o $form.csv
		incise export --no-lineage $form.rec -o all.csv --resample --rate 50 --overwrite
		incise export $form.rec -o $form.mcap
	done
	# one whose seal was taken away is no older one
	for form in 4 5; do
		cp -r $form.rec bare.rec
		sqlite3 bare.rec/recording.db "DELETE FROM seal"
		[[ "$(incise info bare.rec)" == *"seal     none: has no sealed commit"* ]]
		[[ "$(incise info $form.rec)" == *"seal     commit 20, head "*"…, not signed"* ]]
		rm -r bare.rec
	done
	# The virtual rig of form 1 was another one.
	[ "$(sums 1.csv)" = "53 15.820 190.73" ]
	for form in 2 3 4 5; do
		[ "$(sums $form.csv)" = "53 14.797 190.67" ]
	done
	# a row of it that changed is still found
	for form in 3 4 5; do
		"$INCISE_BUILD/tests/sql" $form.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 90"
		fails incise verify $form.rec -- "$form.rec:"
	done
}

@test "a statement of forms 4 and 5 is that of its recording" {
	# at the end of its file, as a comment
	for form in 4 5; do
		sed -n 's/^-- | //p' "$root/tests/forms/$form.sql" >stated
		grep -c . stated
		"$INCISE_BUILD/tests/attack/statement" $form.rec | sed "s/^name $form\$/name f$form/" | diff stated -
		run -0 "$INCISE_BUILD/tests/attack/statement" $form.rec stated
		[ -z "$output" ]
	done
	for form in 1 2 3; do
		run -1 "$INCISE_BUILD/tests/attack/statement" $form.rec
		[[ "$output" == *"has format $form of an older incise"* ]]
	done
}
