# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the shown pose over the cost of a tick, or over the tracker's rate: a panel for each
# motion, a colour for each method; the sixth panel is the key.
rates = suffix eq "rates"
methods = rates ? 8 : 7 # the exact pose is the last one, and has no cost
set style line 11 lc rgb grey lw 1.3 pt 7
set style line 12 lc rgb vermillion lw 1.3 pt 7
set style line 13 lc rgb green lw 1.3 pt 7
set style line 14 lc rgb blue lw 2.2 pt 7
set style line 15 lc rgb orange lw 1.3 pt 7
set style line 16 lc rgb sky lw 1.3 pt 7
set style line 17 lc rgb purple lw 1.3 pt 7
set style line 18 lc rgb ink lw 1 dt 3 pt 0
set multiplot layout 2,3 title sprintf("Error of the shown pose over %s: a tracker that is \
%g ms late, with %g mm of noise and %g %% lost", rates ? "the tracker's rate" : "its cost", \
	delay_ms, noise_mm, lost * 100) font large
set logscale xy
set ylabel 'rms error / mm'
set format y '%g'
set key off
if (rates) {
	set xlabel 'rate of the tracker / Hz'
	set xrange [50:1200]
	set xtics (60, 120, 240, 500, 1000)
} else {
	set xlabel 'time per tick / ns (bars: 5 to 95 %)'
	set xrange [2:400]
	set yrange [0.01:1]
}
block(k) = panel.' '.word(data_name, k)
number(hz) = !rates && (hz == 60 || hz == 1000) ? sprintf('%g', hz) : ''
x(none) = column(rates ? "tracker_hz" : "ns")
bar(key) = column(rates ? "tracker_hz" : key)
do for [i=1:words(data_panel)] {
	panel = word(data_panel, i)
	set title panel
	plot for [k=1:methods] data index block(k) using (x(0)):"rms_mm" \
			with linespoints ls 10+k ps 0.7, \
		for [k=1:methods] data index block(k) \
			using (x(0)):"rms_mm":(bar("ns_p5")):(bar("ns_p95")) \
			with xerrorbars ls 10+k ps 0.7, \
		for [k=1:methods] data index block(k) \
			using (x(0)):"rms_mm":(number(column("tracker_hz"))) \
			with labels noenhanced left offset 0.4,0.4 font small
}
if (!rates) { set label 1 'numbers: Hz of the tracker' at graph 0.1, 0.05 }
unset logscale
unset xlabel
unset ylabel
unset title
unset xtics
unset ytics
unset border
unset grid
set key at graph 0.9, 0.95 top right Left reverse samplen 3 spacing 1.4 font large
set xrange [0:1]
set yrange [0:1]
plot for [k=1:methods] NaN with linespoints ls 10+k \
	title k < 8 ? word(data_name, k) : "exact, as late as the tracker"
unset multiplot
