# SPDX-License-Identifier: GPL-2.0-or-later
# Time and instructions of a tick, a pair of bars for each scene: its own plan above the full
# pipeline, each with its value at its end.
stats data using "tick_ns" nooutput
bar = 0.36
height = 160 + 46 * STATS_records
set multiplot layout 1,2 title sprintf("A tick of each scene, against the full pipeline\n%s, %s", \
	cpu, kernel) font large
set yrange [STATS_records - 0.4:-0.6]
set xrange [0:*]
set offsets 0, graph 0.12, 0, 0
set ytics nomirror scale 0
set grid noytics
set border 3
set key at screen 0.57, screen 18.0 / height center maxrows 1
set bmargin 5
set lmargin at screen 0.17
set rmargin at screen 0.56
set xlabel 'median time of a tick / ns'
set style fill solid 1 noborder
bars(few, full, names) = sprintf("\
data using (0):($0):(0):'%s':($0-bar):($0)%s with boxxyerror fc rgb blue title 'only what the scene needs', \
data using '%s':($0-bar/2):(sprintf('%%.0f', column('%s'))) with labels noenhanced left offset 0.6,0 font small, \
data using (0):($0):(0):'%s':($0):($0+bar) with boxxyerror fc rgb orange title 'every stage kept, neutral', \
data using '%s':($0+bar/2):(sprintf('%%.0f', column('%s'))) with labels noenhanced left offset 0.6,0 font small", \
	few, names, few, few, full, full, full)
eval 'plot '.bars("tick_ns", "full_ns", ":ytic(stringcolumn('name'))")
unset key
set format y ''
set lmargin at screen 0.6
set rmargin at screen 0.97
set xlabel 'instructions of a tick'
if (exists("instructions_by")) { eval 'plot '.bars("instructions", "full_instructions", "") }
unset multiplot
