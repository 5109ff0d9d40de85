# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the exposed length over the time of a picture, a colour for each way to search it.
regions = "whole follows"
titles = "'the whole picture is searched' 'the region follows'"
stats data using "ms_p5" nooutput prefix "fast"
stats data using "ms_p95" nooutput prefix "slow"
stats data using "rms_px" nooutput prefix "good"
stats data using "max_px" nooutput prefix "bad"
set title sprintf("Error of the exposed length over run time\n%s, %s", cpu, kernel)
set xlabel 'processor time of a picture / ms (bars: 5 to 95 %)'
set ylabel 'rms error / pixels (thin lines: up to the largest)'
set logscale xy
set format xy '%g'
set xrange [fast_min / 1.2:slow_max * 1.4]
set yrange [good_min / 1.3:bad_max * 1.3]
set key outside bottom center horizontal
plot for [i=1:2] data index word(regions, i) \
		using "ms":"rms_px":(0):(column("max_px") - column("rms_px")) \
		with vectors nohead ls i lw 0.5, \
	for [i=1:2] data index word(regions, i) using "ms":"rms_px":"ms_p5":"ms_p95" \
		with xerrorbars ls i pt 7 ps 0.8 title word(titles, i), \
	data index "whole" using "ms":"rms_px":"name" \
		with labels noenhanced left rotate by -20 offset 0.6,-0.3 font small, \
	data index "follows" using "ms":"rms_px":"name" \
		with labels noenhanced left rotate by 20 offset 0.6,0.3 font small
