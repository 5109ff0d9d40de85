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

# Exit code, arguments of incise, message.
table() {
	cat <<-'END'
		2|trian|incise: 'trian': no such command; did you mean 'incise train'?
		2|help capure|incise: help capure: no such command or file format; did you mean 'incise help capture'?
		2|bench presision|incise bench: unknown benchmark 'presision'; did you mean 'precision'?
		2|bench loop --load disc|incise bench: --load: expected idle, cpu, memory, disk or view, found 'disc'; did you mean 'disk'?
		2|calibrate forse|incise calibrate: unknown calibration 'forse'; did you mean 'force'?
		2|calibrate depth three-point|incise calibrate depth: unknown method 'three-point'; expected two-point, line or board
		2|stepper mvoe 3|incise stepper: unknown subcommand 'mvoe'; did you mean 'move'?
		2|stepper move|incise stepper: move: missing MM, for example 'incise stepper move 2'
		2|stepper|incise stepper: missing subcommand: status, enable, disable, move, jog, home or clear
		2|tool neck blad|incise tool: unknown tool 'blad'; did you mean 'blade'?
		2|tool|incise tool: missing LOOP (name, as 'incise status' lists it)
		2|train pairs.csv|incise train: missing -o MODEL.fis (output model)
		2|train|incise train: missing DATA.csv or NAME.rec (pairs to learn from)
		2|train pairs.csv --epochs many -o x.fis|incise train: --epochs: expected a whole number from 1 to 100000, found 'many'
		2|train pairs.csv --check 2 -o x.fis|incise train: --check: expected a number from 0.01 to 0.99, found '2'
		2|train pairs.csv --mf 5 -o x.fis|incise train: --mf: expected 2 counts, one for each of --inputs, found 1
		2|train pairs.csv --mf-type gauss -o x.fis|incise train: --mf-type: expected gaussmf or gbellmf, found 'gauss'
		2|train pairs.csv --epoch 5 --frob -o x.fis|incise train: --frob: no such option
		1|train pairs.cvs -o x.fis|incise train: pairs.cvs: no such file; did you mean pairs.csv?
		1|train m.fis -o x.fis|incise train: m.fis: this is a model (.fis), not a CSV table (separated by commas); 'incise info m.fis' describes it, 'incise eval m.fis' runs it
		1|train semicolon.csv -o x.fis|incise train: semicolon.csv: this is a table separated by semicolons, not a CSV table (separated by commas); convert it, and decimal commas with it: sed 's/,/./g; s/;/,/g' semicolon.csv > NEW.csv
		1|train comma.csv -o x.fis|incise train: comma.csv:2: column 4: the row has 6 fields, the header has 3; write decimal points, not commas
		1|train nan.csv -o x.fis|incise train: nan.csv:2: column 2 (velocity_mm_s): nan is not finite; correct it, or remove the row
		1|train header.csv -o x.fis|incise train: header.csv:1: there are no rows below the header; add rows of numbers
		1|train empty.csv -o x.fis|incise train: empty.csv: the file is empty; expected a header row with column names, and rows of numbers
		1|train pairs.csv --target force -o x.fis|incise train: pairs.csv:1: no column 'force'; the columns are: cut, depth_mm, velocity_mm_s, force_N; rename one, or name another
		1|train pairs.csv -o nosuch/x.fis|incise train: nosuch/x.fis: cannot be written: No such file or directory; give another path
		1|train pairs.csv -o m.fis|incise train: m.fis: exists; give --overwrite to replace it, or another path
		2|train pairs.csv -o pairs.fis.csv|incise train: --output: pairs.fis.csv: unknown extension .csv; give .fis
		2|compile m.fis|incise compile: missing -o FILE (output: MODEL.fx of a model, NAME.plan of a scene)
		2|compile m.fis --method tabel -o x.fx|incise compile: --method: expected direct, table or force, found 'tabel'; did you mean 'table'?
		2|compile m.fis --budget 5cm -o x.fx|incise compile: --budget: expected a number, alone or with a unit, for example 1N or 1mN, found '5cm'
		1|compile m.fx -o x.fx|incise compile: m.fx: this is a compiled model (.fx), not a model (.fis) or a scene; give a scene, and the model with --model m.fx
		2|eval|incise eval: missing MODEL.fis or MODEL.fx (model)
		1|eval pairs.csv|incise eval: pairs.csv: this is a CSV table (separated by commas), not a model (.fis) or a compiled model (.fx); learn a model from it: 'incise train pairs.csv -o MODEL.fis'
		1|eval m.fac|incise eval: m.fac: this is a factor (.fac), not a model (.fis) or a compiled model (.fx); make a model of it: 'incise merge m.fac -o MODEL.fis'
		1|eval m.fs|incise eval: m.fs: no such file; did you mean m.fis?
		1|eval m.fis unit.txt|incise eval: unit.txt:1: column 1 (depth_mm): '5mm' is not a number; write 2 numbers without units, and '#' before a heading
		1|eval m.fis comma.txt|incise eval: comma.txt:1: column 3: '20,1' is more than the 2 inputs; write decimal points, not commas
		1|eval m.fis one.txt|incise eval: one.txt:1: column 2 (velocity_mm_s) is missing; a line needs 2 numbers
		2|eval m.fis --arith flaot|incise eval: --arith: expected double or fixed, found 'flaot'
		2|eval m.fis --grid 20|incise eval: --grid: expected NxM with 2 to 10000 each, for example 20x15, found '20'
		2|eval m.fx --no-clamp|incise eval: --no-clamp: m.fx is compiled and cannot extrapolate; give the .fis file that it was compiled from
		1|info pairs.csv|incise info: pairs.csv: this is a CSV table (separated by commas), not a recording, a model (.fis), a compiled model (.fx), a compiled scene (.plan) or a factor (.fac); learn a model from it: 'incise train pairs.csv -o MODEL.fis'
		1|info rig.conf|incise info: rig.conf: this is the configuration of a rig, not a recording, a model (.fis), a compiled model (.fx), a compiled scene (.plan) or a factor (.fac); name it with --rig rig.conf
		2|plan|incise plan: missing SCENE (file, or name of an installed scene, for example liver)
		1|plan livr|incise plan: livr: no such scene; did you mean liver?
		1|plan m.fis|incise plan: m.fis: this is a model (.fis), not a scene; give a scene, and the model with --model m.fis
		1|plan typo.scene|incise plan: typo.scene:2: tisue: unknown key; did you mean tissue?
		1|plan unit.scene|incise plan: unit.scene:2: limits.force_mN: unknown key; expected force_N, in the unit of its name
		1|plan m.fx|incise plan: m.fx: this is a compiled model (.fx), not a scene; give a scene, and the model with --model m.fx
		1|plan stiff.scene|incise plan: stiff.scene: not stable: its tissue has 50 N/mm and 0 N s/mm, but a device of 0.05 kg and 0.01 N s/mm with a tracker of 120 Hz and 4.2 ms is stable up to 0.3997 N/mm, of which 5 % are kept in reserve; set tissue.gain to at most 0.00756, or describe the device
		1|plan rig.conf|incise plan: rig.conf: this is the configuration of a rig, not a scene; name it with --rig rig.conf
		1|haptic typo.scene --rig sim:|incise haptic: typo.scene:2: tisue: unknown key; did you mean tissue?
		2|capture|incise capture: missing -o NAME.rec (output recording)
		2|capture x.rec|incise capture: unexpected argument 'x.rec'; did you mean -o x.rec?
		2|capture -o x.wav --rig sim:|incise capture: -o: expected a name that ends in .rec, found 'x.wav'
		1|capture -o x.rec --rig sim:clok=simulated|incise capture: sim:clok=simulated: clok: unknown key; did you mean clock?
		1|capture -o x.rec --rig sim:sede=1|incise capture: sim:sede=1: sim.sede: unknown key; did you mean seed?
		1|capture -o x.rec --rig sim:seed=-1|incise capture: sim:seed=-1: sim.seed: expected a whole number from 0 to 2147483647, found -1; correct it
		1|capture -o x.rec --rig typo.conf|incise capture: typo.conf:2: tracer_setup: unknown key; did you mean tracker_setup?
		1|capture -o x.rec --rig rig.cnf|incise capture: rig.cnf: no such file; did you mean rig.conf?
		1|capture -o x.rec --rig m.fis|incise capture: m.fis: this is a model (.fis), not the configuration of a rig; 'incise info m.fis' describes it, 'incise eval m.fis' runs it
		2|capture -o x.rec --rig sim: --camera frmaes|incise capture: --camera: expected auto, off, frames or depth, found 'frmaes'; did you mean 'frames'?
		2|capture -o x.rec --rig sim: --duration 5m|incise capture: --duration: expected a duration, for example 10s, 500ms, 2min or 1h, found '5m'
		2|capture -o x.rec --rig sim: --duraton 5s|incise capture: --duraton: no such option; did you mean --duration?
		2|export|incise export: missing NAME.rec (recording to export)
		1|export pairs.csv -o x.csv|incise export: pairs.csv: this is a CSV table (separated by commas), not a recording; 'incise train' learns from one, 'incise calibrate KIND --from' reads readings
		1|verify bad.rec|incise verify: bad.rec: damaged (file is not a database); copy it; `sqlite3 bad.rec/recording.db .recover` may save rows
		1|export bad.rec -o x.csv|incise export: bad.rec: damaged (file is not a database); copy it; `sqlite3 bad.rec/recording.db .recover` may save rows
		1|train pairs.csv --mf 2,2 -o /proc/x.fis|incise train: /proc/x.fis: cannot be written: No such file or directory; give another path
		1|compile m.fis -o ./m.fis --overwrite|incise compile: ./m.fis: is an input (m.fis); give another path to write
		2|verify|incise verify: missing NAME.rec (recording to check)
		1|verify m.fis|incise verify: m.fis: this is a model (.fis), not a recording; 'incise info m.fis' describes it, 'incise eval m.fis' runs it
		2|replay|incise replay: missing NAME.rec (recording)
		1|assess m.fis|incise assess: m.fis: this is a model (.fis), not a session; 'incise info m.fis' describes it, 'incise eval m.fis' runs it
		2|status m.fis --prometheus --json|incise status: --prometheus cannot be combined with --follow or --json
		1|calibrate force --from mass.csv|incise calibrate force: mass.csv:1: expected a line of column names: reading_mV, and mass_g or force_N; series and direction (up, down) are optional
		1|calibrate force --from semicolon.csv|incise calibrate force: semicolon.csv: this is a table separated by semicolons, not a CSV table (separated by commas); convert it, and decimal commas with it: sed 's/,/./g; s/;/,/g' semicolon.csv > NEW.csv
		2|calibrate stepper --range 5mm|incise calibrate stepper: --range: expected two positions, for example 0mm..1.5mm, found '5mm'
		2|calibrate check --only forse|incise calibrate check: --only: expected force, depth, tip, delay or stepper, found 'forse'; did you mean 'force'?
		1|calibrate check -c rig.conf|incise calibrate check: rig.conf: this is the configuration of a rig, not a calibration; name it with --rig rig.conf
	END
}

# bats test_tags=check
@test "each mistake is answered with its message" {
	[ "$(table | wc -l)" -ge 60 ]
	while IFS='|' read -r code arguments message; do
		# shellcheck disable=SC2086 # arguments are words
		run --separate-stderr incise $arguments </dev/null
		[ "$status" -eq "$code" ] || complain "$arguments: exit $status" || return
		[ "${stderr_lines[0]}" = "$message" ] || complain "$arguments: ${stderr_lines[0]}" || return
	done < <(table)
}
