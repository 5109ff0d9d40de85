# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the exposed length over the time of a frame, a colour and marker for each way to search it.
regions = "whole follows"
titles = "'search of the whole frame' 'search near the last blade'"
set title sprintf("Error of the exposed length over run time, by kind of frame\n\
bars: 5 to 95 %% of the frames; upward: to the largest error\n%s, %s", cpu, kernel)
set xlabel 'processor time of a frame / ms'
set ylabel 'rms error of the length / px'
set logscale xy
stats data using "ms_p5" nooutput prefix "fast"
stats data using "ms_p95" nooutput prefix "slow"
stats data using "rms_error_px" nooutput prefix "good"
stats data using "max_error_px" nooutput prefix "bad"
x0 = fast_min / 1.3
x1 = slow_max * 1.3
y0 = good_min / 1.3
y1 = bad_max * 1.3
eval 'set xtics ('.log_tics(x0, x1).')'
eval 'set ytics ('.log_tics(y0, y1).')'
eval name_margins
x(key) = log_place(column(key), x0, x1)
y(key) = log_place(column(key), y0, y1)
# Both ways find the same length: one name for the two points next to each other.
stats data using (strcol("name") eq "name" ? NaN : name_point(strcol("region") eq "whole" ? \
	words_of(strcol("name")) : '', x("ms"), y("rms_error_px"), x("ms_p5"), x("ms_p95"), y("rms_error_px"), y("max_error_px"))) nooutput
eval name_points
set xrange [x0:x1]
set yrange [y0:y1]
eval key_at
plot for [i=1:2] data index word(regions, i) \
		using "ms":"rms_error_px":(0):(column("max_error_px") - column("rms_error_px")) with vectors nohead lt i lw 0.6, \
	for [i=1:2] data index word(regions, i) using "ms":"rms_error_px":"ms_p5":"ms_p95" \
		with xerrorbars lt i lw 1 title word(titles, i)
