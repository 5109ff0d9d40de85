# SPDX-License-Identifier: GPL-2.0-or-later
# Recordings of each form that there was, as the versions of their time wrote them (6d1dcf0a,
# 2c8c1c32, 963d420e, 9da18e94, f8772be0): tests/forms/FORM.sql are their databases, by `.dump`, of
#
#   incise capture -o FORM.rec --duration 1800ms --rig \
#       sim:clock=simulated,seed=1,force_hz=100,tracker_hz=30,cut_s=0.5,pause_s=0.3 \
#       --clock-source sim:1800000000 (from form 3 on)
#
# They open for ever. A new form gets a file of its own here, and the files of others are never made anew.

load cli

setup() {
	work_folder
	for form in 1 2 3 4 5; do
		mkdir $form.rec
		sqlite3 $form.rec/recording.db <"$root/tests/forms/$form.sql"
	done
}

@test "the newest form has its file here" {
	incise capture -o new.rec --rig sim:clock=simulated --duration 100ms >/dev/null 2>&1
	form=$(sqlite3 new.rec/recording.db "PRAGMA user_version")
	[ -e "$root/tests/forms/$form.sql" ]
	[ ! -e "$root/tests/forms/$((form + 1)).sql" ]
}

# bats test_tags=check
@test "recordings of forms 1 to 5 are read, verified and exported" {
	run --separate-stderr incise verify 1.rec
	failed_with "made by an older incise (format 1) without a ledger"
	for form in 2 3 4 5; do
		run -0 --separate-stderr incise verify $form.rec
		[[ "$output" == "force    180 expected, 180 present, 0 lost, in "* ]]
		[[ "$output" == *"$form.rec: complete, and as it was written" ]]
	done
	for form in 2 3; do
		[[ "$(incise verify $form.rec)" == *"seal     none: made by an older incise"* ]]
		[ "$(incise verify --json $form.rec | grep -c '"sealed": false')" -eq 1 ]
	done
	touch signers
	for form in 2 3; do
		run --separate-stderr incise verify $form.rec --signers signers
		failed_with "$form.rec:"
		[[ "$(incise info $form.rec)" == *"seal     none: made by an older incise"* ]]
	done
	# one whose seal was taken away is no older one
	for form in 4 5; do
		cp -r $form.rec bare.rec
		sqlite3 bare.rec/recording.db "DELETE FROM seal"
		[[ "$(incise info bare.rec)" == *"seal     none: has no sealed commit"* ]]
		[[ "$(incise info $form.rec)" == *"seal     commit 20, head "*"…, not signed"* ]]
		[[ "$(incise verify $form.rec)" == *"seal     21 commits, chained"* ]]
		rm -r bare.rec
	done
	for form in 1 2 3 4 5; do
		incise info --json $form.rec >info.json
		[ "$(key info.json rows.force) $(key info.json rows.tracker)" = "180 54" ]
		incise export --no-lineage $form.rec -o $form.csv
		incise export --no-lineage $form.rec -o all.csv --resample --rate 50 --overwrite
		incise export $form.rec -o $form.mcap
	done
	# The virtual rig of form 1 was another one.
	sums() { awk -F, 'NR > 1 { n++; f += $5; d += $3 } END { printf "%d %.3f %.2f", n, f, d }' "$1"; }
	[ "$(sums 1.csv)" = "53 15.820 190.73" ]
	for form in 2 3 4 5; do
		[ "$(sums $form.csv)" = "53 14.797 190.67" ]
	done
	# a row of it that changed is still found
	for form in 3 5; do
		sqlite3 $form.rec/recording.db "UPDATE force SET code = code + 1 WHERE seq = 90"
		run --separate-stderr incise verify $form.rec
		failed_with "$form.rec:"
	done
}

@test "a statement of forms 4 and 5 is that of its recording, and others have none" {
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
		[[ "$output" == *"made by an older incise (format $form), it has no seal" ]]
	done
}
