# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench scenes, as a user meets it. Times are not judged here: the machine is shared.

load cli
load report

# A list of incise plan's report as the text that it is in a row.
in_plan() {
	sqlite3 :memory: "SELECT group_concat($2, ', ') FROM json_each(readfile('p.json'), '\$.$1')"
}

@test "bench scenes has the scenes that ship and its own, and no force differs" {
	quick_report scenes
	for scene in liver neck wall plane_reaction plane_kept plane_constraint sphere_all \
		sphere_all_fixed mesh_reaction mesh_all; do
		[ -z "$(row r.json $scene failed)" ]
		[ "$(row r.json $scene identical)" = 1 ]
		[ -z "$(row r.json $scene first_difference)" ]
		holds "$(row r.json $scene ticks_compared) >= 100000"
		# they were in the tissue for most of it: no force is easily the same
		holds "$(row r.json $scene ticks_in_contact) > 0.7 * $(row r.json $scene ticks_compared)"
		holds "$(row r.json $scene tick_ns) > 0 && $(row r.json $scene full_ns) > 0"
		holds "$(row r.json $scene plan_memory_KiB) <= $(row r.json $scene full_memory_KiB)"
	done
	# what has all stages leaves none of them out; the plain one has none of the rest
	[ "$(row r.json sphere_all left_out)" = "actuate, wound, bleeding" ]
	[ "$(row r.json plane_kept stages)" = "$(row r.json sphere_all stages)" ]
	[ "$(row r.json plane_constraint stages)" = \
		"$(row r.json plane_reaction stages | sed 's/reaction, /reaction, plane, /')" ]
	# the model and the mesh are in memory
	holds "$(row r.json mesh_reaction plan_memory_KiB) > 50 * $(row r.json plane_reaction plan_memory_KiB)"
	holds "$(row r.json mesh_reaction process_own_KiB) > $(row r.json mesh_reaction plan_memory_KiB)"
	# a loop cannot keep what its scene does not need
	[ -z "$(row r.json plane_kept process_memory_KiB)" ]
}

@test "stages are those of incise plan" {
	incise bench scenes --quick --json liver neck >r.json
	for scene in liver neck; do
		incise plan $scene --json >p.json
		[ "$(row r.json $scene stages)" = "$(in_plan kept value)" ]
		[ "$(row r.json $scene left_out)" = \
			"$(in_plan left_out "json_extract(value, '\$.stage')")" ]
	done
}

@test "the loop maps what it is linked to and no more, and opens no device" {
	incise bench scenes --quick --json neck >r.json
	row r.json neck libraries | sed 's/, /\n/g' | sort >mapped
	# the loader's names are links to the files that are mapped
	ldd "$INCISE_BUILD/bin/incise-haptic" | grep -o '/[^ ]*' | xargs -n 1 realpath |
		xargs -n 1 basename | sort >linked
	diff mapped linked
	[ "$(row r.json neck libraries_mapped)" = "$(wc -l <linked)" ]
	for name in SQLite LAPACK libavformat OpenCV OpenGL SDL2; do
		[[ "$(row r.json neck libraries_not_mapped)" == *$name* ]]
	done
	[ "$(row r.json neck devices)" = "tracker, stepper" ]
	[[ "$(row r.json neck files_open)" != */dev/* ]]
}

@test "a scene that cannot be is a row with the reason, and a failure after the report" {
	echo 'tissue = { reaction_N_mm = 50.0; };' >stiff.scene
	run -1 --separate-stderr incise bench scenes --quick --json stiff.scene none wall
	echo "$output" >r.json
	failed_with stiff.scene "not measured" "not stable"
	[[ "$(row r.json stiff.scene failed)" == *"not stable"* ]]
	[ -z "$(row r.json stiff.scene tick_ns)" ]
	[ -z "$(row r.json stiff.scene stages)" ]
	[ -z "$(row r.json stiff.scene identical)" ]
	[[ "$(row r.json none failed)" == *"no scene of that name"* ]]
	run -1 --separate-stderr incise bench scenes --quick $'no\e[2J'
	[[ "$output" == *"no?[2J"* && "$output" != *$'\e'* ]]
	holds "$(row r.json wall tick_ns) > 0"
	[ "$(row r.json wall identical)" = 1 ]
}

@test "bench scenes says it as text" {
	run -0 --separate-stderr incise bench scenes --quick neck wall
	[ -z "$stderr" ]
	[[ "$output" == *$'\nwall '*" same"* ]]
	[[ "$output" == *$'\n  left out  tool, '* ]]
	[[ "$output" == *$'\n  not these SQLite, '* ]]
}
