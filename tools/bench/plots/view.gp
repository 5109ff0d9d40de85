# SPDX-License-Identifier: GPL-2.0-or-later
# Error of what a screen shows over the run time for it, a line for each texture; at each point a
# marker, the larger the more frames per second.
n = words(data_blocks)
titles = "'rms error of sRGB values (0 to 255) / 1' '1 − structural similarity / 1'"
# Where two are the same to the last digit there is no place of 0.
place(x) = x > 1e-6 ? x : 1e-6
error(k) = place(k == 1 ? column("rms_error") : 1 - column("ssim"))
layout = panels(80, 20, below(1), 2.8 * line_px + 10, 90, 0)
set multiplot layout 1,2 @layout \
	title sprintf("Shown image of a bleeding cut, compared with a texture of %d² drawn at that very moment\n\
markers, small to large: 15, 30 and 60 frames per second", word(data_texture_px, n) + 0) noenhanced
set key off
set xlabel 'run time for one second of images / ms'
size(none) = 0.5 + 0.4 * log(column("fps") / 15) / log(2)
do for [k=1:2] {
	set ylabel word(titles, k)
	unset logscale
	set autoscale
	stats data using "ms_per_s" prefix "x" nooutput
	stats data using (error(k)) prefix "y" nooutput
	set logscale xy
	set xrange [x_min / 1.3:x_max * 1.3]
	set yrange [y_min / 1.3:y_max * 1.3]
	eval 'set xtics ('.log_tics(x_min / 1.3, x_max * 1.3).')'
	if (y_max / y_min > 1e3) { set format y power; set ytics auto } else {
		set format y '%g'; eval 'set ytics ('.log_tics(y_min / 1.3, y_max * 1.3).')' }
	plot for [i=1:n] data index word(data_blocks, i) using "ms_per_s":(error(k)) with lines lt i, \
		for [i=1:n] data index word(data_blocks, i) using "ms_per_s":(error(k)):(size(0)) \
			with points lt i ps variable
}
eval key_panel
plot for [i=1:n] NaN with linespoints lt i title sprintf("texture of %s²", word(data_blocks, i))
unset multiplot
