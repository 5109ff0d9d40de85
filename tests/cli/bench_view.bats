# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench view, as a user meets it: the form of what it says. Times are not judged here.

load cli

setup() {
	[ -e "$INCISE_BUILD/bin/incise-bench-view" ] ||
		skip "incise-bench-view is not built: SDL2, epoxy, cairo or EGL was absent"
	work_folder
}

# Whether OpenGL draws here without a screen.
draws() {
	incise view "$root/scenes/neck.scene" --procedure -o none --duration 0.1s \
		>out 2>err || skip "nothing draws here: $(cat err)"
}

@test "incise view -o none says how often it drew" {
	draws
	[ "$(wc -l <out)" = 1 ]
	[[ "$(cat out)" =~ ^[0-9.]+\ frames\ per\ second:\ [0-9]+\ in\ [0-9.]+\ s,\ 1280x720,\ 2048\ texels,\ .+ ]]
	run --separate-stderr incise view "$root/scenes/neck.scene" --procedure -o none \
		-o a.png --at 1s
	bad_usage "-o none"
}

# bats test_tags=slow
@test "bench view reports as JSON" {
	draws
	run -0 --separate-stderr incise bench view --quick --json
	[ -z "$stderr" ]
	echo "$output" >r.json
	[ "$(key r.json quick)" = 1 ]
	[ -n "$(key r.json renderer)" ]
	[ "$(key r.json frames[0].texture_px) $(key r.json frames[0].width)" = "1024 1280" ]
	holds "$(key r.json frames[0].triangles) >= 19000"
	for i in 0 1 2; do
		for part in effects texture draw whole; do
			median=$(key r.json "frames[$i].${part}_ms.median")
			holds "$median > 0 && $median <= $(key r.json "frames[$i].${part}_ms.max")"
		done
		holds "$(key r.json "frames[$i].texels") > 0"
	done
	# of the same ticks: the finer the texture, the nearer; the more frames, the nearer
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'), '$.shown.rows')")" = 7 ]
	[ "$(key r.json shown.exact_texture_px)" = 1024 ]
	exact() {
		sqlite3 :memory: "SELECT json_extract(value, '\$.$2')
			FROM json_each(readfile('r.json'), '\$.shown.rows')
			WHERE json_extract(value, '\$.texture_px') = $1
			AND json_extract(value, '\$.fps') IS ${3:-NULL}"
	}
	holds "$(exact 512 rms_error) > 0 && $(exact 512 rms_error 60) > $(exact 1024 rms_error 60)"
	holds "$(exact 512 ssim 60) < $(exact 1024 ssim 60) && $(exact 512 ssim) < 1"
	holds "$(exact 1024 rms_error 15) > $(exact 1024 rms_error 60) && $(exact 1024 rms_error 60) > 0"
	holds "$(exact 512 rms_error 15) > $(exact 512 rms_error)"
	incise bench compare r.json r.json
	holds "$(key r.json frames[0].in_20_ms_percent) >= 0 && $(key r.json frames[0].in_20_ms_percent) <= 100"
}

@test "bench view: a scene that is not there" {
	fails incise bench view none.scene -- none.scene
}
