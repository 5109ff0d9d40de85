# SPDX-License-Identifier: GPL-2.0-or-later
# Error of a sample's time over its cost, or over how much was seen: a panel for each kind of
# lateness, a colour and marker for each method.
windows = suffix eq "windows"
order = "8 5 2 3 4 1 7 6" # of colours: the line in blue, the arrival in grey
do for [k=1:8] {
	set style line 10+k lc rgb colour(int(word(order, k))) lw k == 6 || k == 8 ? 2.2 : 1.2 \
		pt int(word('2 11 5 9 13 7 4 6', k))
}
layout = panels(90, 20, below(3), above(2), 30, 0)
set multiplot layout 1,3 @layout \
	title sprintf("Error of acquisition times over %s\n%d Hz by a clock that is off by %g ppm, up to %d ms late%s", \
	windows ? "the length of the recording" : "their cost", rate_hz, drift_ppm, late_ms, windows ? "" : \
	"; larger markers: 1 to 120 s seen; bars: 5 to 95 %") noenhanced
stats data using "rms_error_us" nooutput
if (!windows) {
	stats data using "ns_p5" prefix "fast" nooutput
	stats data using "ns_p95" prefix "slow" nooutput
}
set logscale xy
set ylabel 'rms error of the time / µs'
set key off
set format xy power
set yrange [STATS_min / 2:STATS_max * 2]
if (windows) {
	set xlabel 'length seen / s'
	set format x '%g'
	set xrange [0.8:150]
	set xtics (1, 2, 5, 10, 30, 120)
} else {
	set xlabel 'time per sample / ns'
	set xrange [fast_min / 1.3:slow_max * 1.3]
	if (slow_max / fast_min < 1e3) { set format x '%g'; eval 'set xtics ('.log_tics(fast_min / 1.3, slow_max).')' }
}
block(k) = word(data_late, i).' '.word(data_name, k)
size(none) = 0.4 + 0.7 * log(column("window_s")) / log(120)
do for [i=1:words(data_late)] {
	set title sprintf("(%s) lateness: %s", "abc"[i:i], word(data_late, i))
	if (windows) {
		plot for [k=1:8] data index block(k) using "window_s":"rms_error_us" \
				with linespoints ls 10+k ps 0.8, \
			for [k=6:8] data index block(k) using "window_s":"stated_us" \
				with lines ls 10+k dt 3
	} else {
		plot for [k=1:8] data index block(k) using "ns_per_sample":"rms_error_us" with lines ls 10+k, \
			for [k=1:8] data index block(k) \
				using "ns_per_sample":"rms_error_us":"ns_p5":"ns_p95" with xerrorbars ls 10+k lw 0.7 pt 0, \
			for [k=1:8] data index block(k) \
				using "ns_per_sample":"rms_error_us":(size(0)) with points ls 10+k ps variable
	}
	unset ylabel
	set format y ''
}
eval key_panel
set key maxcols 4
plot for [k=1:8] NaN with linespoints ls 10+k ps 0.8 title words_of(word(data_name, k)), \
	for [k=6:5 + 3 * windows] NaN with lines ls 10+k dt 3 title words_of(word(data_name, k)).', stated'
unset multiplot
