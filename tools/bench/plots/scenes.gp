# SPDX-License-Identifier: GPL-2.0-or-later
# Time of a tick, a pair of bars for each scene: its own plan above the full pipeline, each with its
# value at its end.
stats data using "tick_ns" nooutput
rows = STATS_records
bar = 0.36
set multiplot layout 1,1 title sprintf("A tick of each scene compared with the full pipeline\n%s, %s", \
	cpu, kernel) noenhanced
stats data using (column("tick_ns") > column("full_ns") ? column("tick_ns") : column("full_ns")) nooutput
set xrange [0:STATS_max * 1.15]
set yrange [rows - 0.4:-0.6]
set offsets 0, graph 0.12, 0, 0
set grid noytics
set key off
set bmargin at screen below(1) / figure_height
set tmargin at screen 1 - (2.4 * line_px + 10) / figure_height
set lmargin at screen 160.0 / figure_width
set rmargin at screen 1 - 20.0 / figure_width
set style fill solid noborder
set ytics nomirror scale 0 noenhanced
set xlabel 'median time of a tick / ns'
plot data using (0):($0):(0):(column("tick_ns")):($0-bar):($0):ytic(words_of(strcol("name"))) \
		with boxxyerror fc rgb blue, \
	data using (column("tick_ns")):($0-bar/2):(sprintf('%.0f', column("tick_ns"))) with labels left offset 0.5,0 font small, \
	data using (0):($0):(0):(column("full_ns")):($0):($0+bar) \
		with boxxyerror fc rgb orange, \
	data using (column("full_ns")):($0+bar/2):(sprintf('%.0f', column("full_ns"))) with labels left offset 0.5,0 font small
eval key_panel
plot NaN with boxes fc rgb blue title 'only the stages needed', NaN with boxes fc rgb orange title 'all stages'
unset multiplot
