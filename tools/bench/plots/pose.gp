# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the shown pose over the cost of a tick, or over the tracker's rate: a panel for each
# motion, a colour and marker for each method; the sixth panel is the key.
rates = suffix eq "rates"
methods = rates ? 8 : 7 # the exact pose is the last one, and has no cost
title(k) = word("held line parabola library 'library, 5 µm' 'library, 100 µm' 'library, punctual' \
'exact, as late as the tracker'", k)
order = "8 2 3 1 5 6 4 7" # of colours: the library in blue, the held pose in grey
do for [k=1:8] {
	c = int(word(order, k))
	set style line 10+k lc rgb (k == 8 ? ink : colour(c)) lw k == 4 ? 2.5 : 1.2 dt k == 8 ? 3 : 1 \
		pt int(word('2 5 9 7 11 6 13 0', k))
}
stats data using (strcol("name") eq "exact_delayed" && !rates ? NaN : column("rms_error_mm")) nooutput
if (!rates) {
	stats data using "ns_p5" prefix "fast" nooutput
	stats data using "ns_p95" prefix "slow" nooutput
}
layout = panels(80, 20, below(0), above(1), 30, between)
set multiplot layout 2,3 @layout \
	title sprintf("Error of the shown pose over %s: tracker %g ms late, with %g mm of noise and %g %% lost", \
	rates ? "the tracker's rate" : "its cost", delay_ms, noise_mm, lost * 100) noenhanced
set logscale xy
set yrange [STATS_min / 1.5:STATS_max * 1.5]
set key off
if (rates) {
	set xtics (60, 120, 240, 500, 1000)
	set xrange [50:1200]
} else {
	set xrange [fast_min / 1.3:slow_max * 1.3]
	eval 'set xtics ('.log_tics(fast_min / 1.3, slow_max).')'
}
block(k) = panel.' '.word(data_name, k)
x(none) = column(rates ? "tracker_hz" : "ns")
bar(key) = column(rates ? "tracker_hz" : key)
# In a plot over the cost a larger marker is of a faster tracker.
size(none) = rates ? 0.7 : 0.35 + 0.3 * log(column("tracker_hz") / 60) / log(2) * 0.6
do for [i=1:words(data_panel)] {
	panel = word(data_panel, i)
	set title sprintf("(%s) %s", "abcdef"[i:i], panel) font small
	set ylabel i % 3 == 1 ? 'rms error of the position / mm' : ''
	set format y i % 3 == 1 ? '%g' : ''
	set format x '%g'
	set xlabel i > 2 ? (rates ? 'rate of the tracker / Hz' : 'time per tick / ns') : ''
	plot for [k=1:methods] data index block(k) using (x(0)):"rms_error_mm" with lines ls 10+k, \
		for [k=1:methods-rates] data index block(k) \
			using (x(0)):"rms_error_mm":(size(0)) with points ls 10+k ps variable, \
		for [k=1:(rates ? 0 : methods)] data index block(k) \
			using (x(0)):"rms_error_mm":(bar("ns_p5")):(bar("ns_p95")) with xerrorbars ls 10+k lw 0.7 pt 0
}
unset logscale
unset xlabel
unset ylabel
unset title
unset xtics
unset ytics
unset border
unset grid
set key at graph 0.05, 0.9 top left spacing 1.3
set xrange [0:1]
set yrange [0:1]
if (!rates) {
	set label 1 "bars: 5 to 95 % of the runs\nlarger markers: faster tracker,\n60 to 1000 Hz" at graph 0.06, 0.1 font small
}
plot for [k=1:methods] NaN with linespoints ls 10+k ps 0.8 title title(k)
unset multiplot
