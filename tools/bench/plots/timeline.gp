# SPDX-License-Identifier: GPL-2.0-or-later
# Error of a sample's time over its cost, or over how much was seen: a panel for each kind of
# lateness, a colour for each method.
windows = suffix eq "windows"
set style line 11 lc rgb grey lw 1.3
set style line 12 lc rgb orange lw 1.3
set style line 13 lc rgb vermillion lw 1.3
set style line 14 lc rgb green lw 1.3
set style line 15 lc rgb purple lw 1.3
set style line 16 lc rgb blue lw 2.2
set style line 17 lc rgb ink lw 1
set style line 18 lc rgb sky lw 2.2
set multiplot layout 1,3 title sprintf("Error of times of acquisition over %s: %d Hz by a clock \
that is off by %g ppm, up to %d ms late", windows ? "how much was seen" : "their cost", rate_hz, \
	drift_ppm, late_ms) font large
set logscale xy
set ylabel 'rms error / µs'
set key bottom left Left reverse samplen 2 spacing 0.95 font small
set format y '%g'
if (windows) {
	set xlabel 'seen / s'
	set xrange [0.8:150]
	set xtics (1, 2, 5, 10, 30, 60, 120)
	set yrange [1:30000]
} else {
	# Space below for the key.
	set xlabel 'time per sample / ns (bars: 5 to 95 %)'
	set xrange [2:2000]
	set yrange [0.05:30000]
}
block(k) = word(data_late, i).' '.word(data_name, k)
number(s) = s == 1 || s == 120 ? sprintf('%g s', s) : ''
do for [i=1:words(data_late)] {
	set title 'lateness: '.word(data_late, i)
	if (windows) {
		plot for [k=1:8] data index block(k) using "window_s":"rms_us" \
				with linespoints ls 10+k pt 7 ps 0.8 title word(data_name, k), \
			for [k=6:8] data index block(k) using "window_s":"stated_us" \
				with lines ls 10+k dt 3 title word(data_name, k).', stated'
	} else {
		plot for [k=1:8] data index block(k) using "ns_per_sample":"rms_us" \
				with lines ls 10+k, \
			for [k=1:8] data index block(k) \
				using "ns_per_sample":"rms_us":"ns_p5":"ns_p95" \
				with xerrorbars ls 10+k pt 7 ps 0.7 title word(data_name, k), \
			for [k=1:8] data index block(k) \
				using "ns_per_sample":"rms_us":(number(column("window_s"))) \
				with labels noenhanced left offset 0.5,0.4 font small
	}
}
unset multiplot
