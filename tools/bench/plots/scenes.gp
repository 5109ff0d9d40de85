# SPDX-License-Identifier: GPL-2.0-or-later
# Time and instructions of a tick, a pair of bars for each scene: its own plan above the full
# pipeline, each with its value at its end.
stats data using "tick_ns" nooutput
rows = STATS_records
counted = exists("instructions_by")
bar = 0.36
few_key(k) = k ? "instructions" : "tick_ns"
full_key(k) = k ? "full_instructions" : "full_ns"
bigger(k) = column(few_key(k)) > column(full_key(k)) ? column(few_key(k)) : column(full_key(k))
set multiplot layout 1,counted ? 2 : 1 title sprintf("A tick of each scene compared with the full pipeline\n%s, %s", \
	cpu, kernel) noenhanced
array most[2]
do for [k=0:counted] {
	stats data using (bigger(k)) nooutput
	most[k + 1] = STATS_max
}
set yrange [rows - 0.4:-0.6]
set offsets 0, graph 0.12, 0, 0
set ytics nomirror scale 0
set grid noytics
set key off
set bmargin at screen below(1) / figure_height
set tmargin at screen 1 - (2.4 * line_px + 10) / figure_height
set lmargin at screen 160.0 / figure_width
set rmargin at screen counted ? 0.58 : 1 - 20.0 / figure_width
set style fill solid noborder
set ytics noenhanced
names(x) = counted && x ? '' : words_of(strcol("name"))
do for [k=0:counted] {
	few = few_key(k)
	full = full_key(k)
	set xlabel k ? 'instructions per tick / 1' : 'median time of a tick / ns'
	set xrange [0:most[k + 1] * 1.15]
	if (k) {
		set format y ''
		set lmargin at screen 0.61
		set rmargin at screen 0.98
	}
	plot data using (0):($0):(0):(column(few)):($0-bar):($0):ytic(names(k)) \
			with boxxyerror fc rgb blue, \
		data using (column(few)):($0-bar/2):(sprintf('%.0f', column(few))) with labels left offset 0.5,0 font small, \
		data using (0):($0):(0):(column(full)):($0):($0+bar) \
			with boxxyerror fc rgb orange, \
		data using (column(full)):($0+bar/2):(sprintf('%.0f', column(full))) with labels left offset 0.5,0 font small
}
eval key_panel
plot NaN with boxes fc rgb blue title 'only the stages needed', NaN with boxes fc rgb orange title 'all stages'
unset multiplot
