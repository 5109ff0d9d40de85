# SPDX-License-Identifier: GPL-2.0-or-later
# Mistakes that a user makes, each with its exit code and the first line on stderr: what is wrong, where,
# and what to do.

load cli

setup() {
	work_folder
	made_pairs >pairs.csv
	incise train pairs.csv --mf 2,2 -o m.fis >/dev/null 2>&1
	incise compile m.fis -o m.fx >/dev/null
	printf 'tracker = "sim:"; force = "sim:";\n' >rig.conf
	printf 'tracker = "sim:";\ntracer_setup = { };\n' >typo.conf
	printf 'tisue = { reaction_N_mm = 0.1; }; rate_hz = 1000;\n' >line.scene
	printf 'model = "m.fis";\ntisue = { plane_N_mm = 0.1; };\n' >typo.scene
	printf 'model = "m.fis";\nlimits = { force_mN = 4000; };\n' >unit.scene
	printf 'depth_mm;velocity_mm_s;force_N\n1,5;20,1;0,3\n' >semicolon.csv
	printf 'depth_mm,velocity_mm_s,force_N\n1,5,20,1,0,3\n' >comma.csv
	printf 'depth_mm,velocity_mm_s,force_N\n1,nan,3\n' >nan.csv
	printf 'depth_mm,velocity_mm_s,force_N\n' >header.csv
	: >empty.csv
	printf 'mass,reading_mV\n0,180\n' >mass.csv
	printf '5mm 20\n' >unit.txt
	printf '5,3 20,1\n' >comma.txt
	printf '5\n' >one.txt
	printf 'tissue = { reaction_N_mm = 50.0; };\n' >stiff.scene
	printf 'incise factor 1\n' >m.fac
	mkdir bad.rec
	head -c 4096 /dev/zero >bad.rec/recording.db
}

# Exit code, arguments of incise, pieces of the message.
table() {
	cat <<-'END'
		2|trian|'trian':|incise train
		2|help capure|help capure|incise help capture
		2|bench presision|presision|precision
		2|bench loop --load disc|--load:|disk
		2|calibrate forse|forse|force
		2|calibrate depth three-point|three-point
		2|stepper mvoe 3|mvoe|move
		2|stepper move|move:|MM
		2|stepper|missing subcommand
		2|tool neck blad|blad|blade
		2|tool|LOOP
		2|train pairs.csv pairs.csv|-o MODEL.fis
		2|train|DATA.csv
		2|train pairs.csv --epochs many -o x.fis|--epochs:|'many'
		2|train pairs.csv --check 2 -o x.fis|--check:|'2'
		2|train pairs.csv --mf 5 -o x.fis|--mf:|1
		2|train pairs.csv --search type=gauss -o x.fis|--search type:|'gauss'
		2|train pairs.csv --epoch 5 --frob -o x.fis|--frob:
		1|train pairs.cvs -o x.fis|pairs.cvs:|pairs.csv
		1|train m.fis -o x.fis|m.fis:|.fis
		1|train semicolon.csv -o x.fis|semicolon.csv:
		1|train comma.csv -o x.fis|comma.csv:2: column 4:|6
		1|train nan.csv -o x.fis|nan.csv:2: column 2 (velocity_mm_s):
		1|train header.csv -o x.fis|header.csv:1:
		1|train empty.csv -o x.fis|empty.csv:
		1|train pairs.csv --target force -o x.fis|pairs.csv:1:|force
		1|train pairs.csv -o nosuch/x.fis|nosuch/x.fis:
		1|train pairs.csv -o m.fis|m.fis:|--overwrite
		2|train pairs.csv -o pairs.fis.txt|--output: pairs.fis.txt:
		2|compile m.fis|-o FILE
		2|compile m.fis --method tabel -o x.fx|--method:|table
		2|compile m.fis --budget 5cm -o x.fx|--budget:|'5cm'
		1|compile m.fx -o x.fx|m.fx:|.fx
		2|eval|MODEL.fis
		1|eval pairs.csv|pairs.csv:
		1|eval m.fac|m.fac:|.fac
		1|eval m.fs|m.fs:|m.fis
		1|eval m.fis unit.txt|unit.txt:1: column 1 (depth_mm):|5mm
		1|eval m.fis comma.txt|comma.txt:1: column 3:|20,1
		1|eval m.fis one.txt|one.txt:1: column 2 (velocity_mm_s)
		2|eval m.fis --arith flaot|--arith:|'flaot'
		2|eval m.fis --grid 20|--grid:|'20'
		2|eval m.fx --no-clamp|--no-clamp:
		1|info pairs.csv|pairs.csv:
		2|plan|SCENE
		1|plan livr|livr:|liver
		1|plan m.fis|m.fis:|.fis
		1|plan typo.scene|typo.scene:2: tisue:|tissue
		1|plan line.scene|line.scene:1: tisue:|tissue
		1|plan unit.scene|unit.scene:2: limits.force_mN:|force_N
		1|plan m.fx|m.fx:|.fx
		1|plan stiff.scene|stiff.scene:|not stable|tissue.gain to at most 0.007
		1|plan rig.conf|rig.conf:|--rig
		1|haptic typo.scene --rig sim:|typo.scene:2: tisue:|tissue
		2|capture|-o NAME.rec
		2|capture x.rec|-o x.rec
		2|capture -o x.wav --rig sim:|-o:|'x.wav'
		1|capture -o x.rec --rig sim:clok=simulated|sim:clok=simulated:|clock
		1|capture -o x.rec --rig sim:sede=1|sim:sede=1:|seed
		1|capture -o x.rec --rig sim:seed=-1|sim:seed=-1:|-1
		1|capture -o x.rec --rig typo.conf|typo.conf:2: tracer_setup:|tracker_setup
		1|capture -o x.rec --rig rig.cnf|rig.cnf:|rig.conf
		1|capture -o x.rec --rig sim|sim:|colon
		1|capture -o x.rec --rig m.fis|m.fis:|.fis
		2|capture -o x.rec --rig sim: --camera frmaes|--camera:|frames
		2|capture -o x.rec --rig sim: --duration 5m|--duration:|'5m'
		2|capture -o x.rec --rig sim: --duraton 5s|--duraton:|--duration
		2|export|NAME.rec
		1|export pairs.csv -o x.csv|pairs.csv:
		1|verify bad.rec|bad.rec:
		1|export bad.rec -o x.csv|bad.rec:
		1|train pairs.csv --mf 2,2 -o /proc/x.fis|/proc/x.fis:
		1|compile m.fis -o ./m.fis --overwrite|./m.fis:
		2|verify|NAME.rec
		1|verify m.fis|m.fis:|.fis
		2|replay|NAME.rec
		1|assess m.fis|m.fis:|.fis
		2|status m.fis --prometheus --json|--prometheus|--json
		1|calibrate force --from mass.csv|mass.csv:1:
		1|calibrate force --from semicolon.csv|semicolon.csv:
		2|calibrate stepper --range 5mm|--range:|'5mm'
		2|calibrate check --only forse|--only:|force
		1|calibrate check -c rig.conf|rig.conf:|--rig
	END
}

# bats test_tags=check
@test "each mistake is answered with its message" {
	[ "$(table | wc -l)" -ge 60 ]
	while IFS='|' read -r code arguments first second third; do
		# shellcheck disable=SC2086 # arguments are words
		run --separate-stderr incise $arguments </dev/null
		[ "$status" -eq "$code" ] || complain "$arguments: exit $status" || return
		[[ "${stderr_lines[0]}" == "incise"*": "* ]] || complain "$arguments: $stderr" || return
		holds_pieces "${stderr_lines[0]}" "$first" "$second" "$third" || return
	done < <(table)
}
