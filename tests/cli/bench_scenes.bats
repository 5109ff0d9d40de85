# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench scenes, as a user meets it. Times are not judged here: the machine is shared.

load cli

setup() {
	work_folder
}

# A value of the row with a name: of wall stages.
of() {
	local k
	k=$(sqlite3 :memory: "SELECT key FROM json_each(readfile('r.json'), '\$.rows')
		WHERE json_extract(value, '\$.name') = '$1'")
	[ -n "$k" ] || complain "no row $1" || return
	key r.json "rows[$k].$2"
}

# A list of incise plan's report as the text that it is in a row.
in_plan() {
	sqlite3 :memory: "SELECT group_concat($2, ', ') FROM json_each(readfile('p.json'), '\$.$1')"
}

@test "bench scenes has the scenes that ship and its own, and no force differs" {
	quick_report scenes
	for scene in liver neck wall plane_reaction plane_kept plane_constraint sphere_all \
		sphere_all_fixed mesh_reaction mesh_all; do
		[ -z "$(of $scene failed)" ]
		[ "$(of $scene identical)" = 1 ]
		[ -z "$(of $scene first_difference)" ]
		holds "$(of $scene ticks_compared) >= 100000"
		# they were in the tissue for most of it: no force is easily the same
		holds "$(of $scene ticks_in_contact) > 0.7 * $(of $scene ticks_compared)"
		holds "$(of $scene tick_ns) > 0 && $(of $scene full_ns) > 0"
		holds "$(of $scene plan_memory_KiB) <= $(of $scene full_memory_KiB)"
	done
	# what has all stages leaves none of them out; the plain one has none of the rest
	[ "$(of sphere_all left_out)" = "actuate, wound, bleeding" ]
	[ "$(of plane_kept stages)" = "$(of sphere_all stages)" ]
	[ "$(of plane_constraint stages)" = \
		"$(of plane_reaction stages | sed 's/reaction, /reaction, plane, /')" ]
	# the model and the mesh are in memory
	holds "$(of mesh_reaction plan_memory_KiB) > 100 * $(of plane_reaction plan_memory_KiB)"
	holds "$(of mesh_reaction process_own_KiB) > $(of mesh_reaction plan_memory_KiB)"
	# a loop cannot keep what its scene does not need
	[ -z "$(of plane_kept process_memory_KiB)" ]
}

@test "stages and reasons are those of incise plan" {
	incise bench scenes --quick --json liver neck >r.json
	for scene in liver neck; do
		incise plan $scene --json >p.json
		[ "$(of $scene stages)" = "$(in_plan kept value)" ]
		[ "$(of $scene left_out)" = \
			"$(in_plan left_out "json_extract(value, '\$.stage')")" ]
		[ "$(sqlite3 :memory: "SELECT json_group_array(json_array(
			json_extract(value, '\$.stage'), json_extract(value, '\$.why')))
			FROM json_each(readfile('r.json'), '\$.left_out')
			WHERE json_extract(value, '\$.scene') = '$scene'")" = \
			"$(sqlite3 :memory: "SELECT json_group_array(json_array(
			json_extract(value, '\$.stage'), json_extract(value, '\$.why')))
			FROM json_each(readfile('p.json'), '\$.left_out')")" ]
	done
}

@test "the loop maps what it is linked to and no more, and opens no device" {
	incise bench scenes --quick --json neck >r.json
	of neck libraries | sed 's/, /\n/g' | sort >mapped
	# the loader's names are links to the files that are mapped
	ldd "$INCISE_BUILD/bin/incise-haptic" | grep -o '/[^ ]*' | xargs -n 1 realpath |
		xargs -n 1 basename | sort >linked
	diff mapped linked
	[ "$(of neck libraries_mapped)" = "$(wc -l <linked)" ]
	for name in SQLite LAPACK libavformat OpenCV OpenGL SDL2; do
		[[ "$(of neck libraries_not_mapped)" == *$name* ]]
	done
	[ "$(of neck devices)" = "tracker, stepper" ]
	[[ "$(of neck files_open)" != */dev/* ]]
}

@test "the full pipeline takes more instructions where stages are left out" {
	command -v valgrind >/dev/null || skip "valgrind is not installed, it counts instructions"
	incise bench scenes --json wall >r.json
	[ -n "$(key r.json instructions_by)" ] || skip "$(key r.json instructions_failed)"
	holds "$(of wall instructions) > 100"
	holds "$(of wall full_instructions) > 1.1 * $(of wall instructions)"
}

@test "without a counter and valgrind instructions are null, and why is said" {
	mkdir bin
	PATH="$PWD/bin" "$INCISE_BUILD/bin/incise" bench scenes --json wall >r.json
	[ "$(key r.json instructions_by)" != callgrind ]
	if [ -z "$(key r.json instructions_by)" ]; then
		[[ "$(key r.json instructions_failed)" == *valgrind* ]]
		[ -z "$(of wall instructions)" ]
	fi
}

@test "a scene that cannot be is a row with the reason, and a failure after the report" {
	echo 'tissue = { reaction_N_mm = 50.0; };' >stiff.scene
	run -1 --separate-stderr incise bench scenes --quick --json stiff.scene none wall
	echo "$output" >r.json
	failed_with stiff.scene "not measured" "not stable"
	[[ "$(of stiff.scene failed)" == *"not stable"* ]]
	[ -z "$(of stiff.scene tick_ns)" ]
	[ -z "$(of stiff.scene stages)" ]
	[ -z "$(of stiff.scene identical)" ]
	[[ "$(of none failed)" == *"no scene of that name"* ]]
	run -1 --separate-stderr incise bench scenes --quick $'no\e[2J'
	[[ "$output" == *"no?[2J"* && "$output" != *$'\e'* ]]
	holds "$(of wall tick_ns) > 0"
	[ "$(of wall identical)" = 1 ]
}

@test "bench scenes says it as text, and draws bars" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the bars"
	run -0 --separate-stderr incise bench scenes --quick neck wall --plot bars
	[ -z "$stderr" ]
	[[ "$output" == *$'\nwall '*" same"* ]]
	[[ "$output" == *"tissue.plane_N_mm is 0"* ]]
	[[ "$output" == *$'\n  not these SQLite, '* ]]
	for scene in neck wall; do
		grep -q ">$scene<" bars.svg
	done
	[ -s bars.png ]
}

@test "one course of a scene runs alone for a profiler" {
	for which in needed full; do
		run -0 --separate-stderr incise bench scenes wall --profile $which
		[ -z "$output$stderr" ]
	done
	run --separate-stderr incise bench scenes wall --profile some
	bad_usage "neither needed nor full"
	run --separate-stderr incise bench scenes wall neck --profile full
	bad_usage "one scene"
	run --separate-stderr incise bench training --profile full
	bad_usage "--profile does not go with 'training'"
	run --separate-stderr incise bench scenes none --profile full
	failed_with none
}
